"""Robust laws: each wrapper against its own theory, then inside the loop."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mrac_design.controller.adaptation import (
    AdaptationSignals,
    GradientLaw,
    NormalisedGradientLaw,
)
from mrac_design.controller.adaptive import AdaptiveRST, build_step, nominal_gains
from mrac_design.controller.reference import ModelInverse
from mrac_design.controller.robust import (
    GainBox,
    WithDeadZone,
    WithErrorLeakage,
    WithLeakage,
    WithProjection,
)
from mrac_design.design import ReferenceModel, RSTSpecification, design_rst, first_order_observer
from mrac_design.errors import ParameterError
from mrac_design.motion.reference import constant_force
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.plant import ForcePlant
from mrac_design.simulation.run import RunSettings
from mrac_design.simulation.single_axis import (
    axis_inputs,
    build_axis_loop,
    build_sampled_axis_loop,
    simulate_axis,
    white_noise,
)
from mrac_design.time_domain import Continuous, Discrete

CENTRE = (1.9, 2.7, 1.0, 1.0, 1.0)
BOX = GainBox.around(CENTRE, fraction=0.2)
GRADIENT = GradientLaw(gain=(0.5, 1.0, 2.0, 1.0, 0.7))
NORMALISED = NormalisedGradientLaw(gain=1.0, alpha=0.1)
LAWS = {
    "projection": WithProjection(law=GRADIENT, box=BOX),
    "dead zone": WithDeadZone(law=GRADIENT, width=0.2),
    "leakage": WithLeakage(law=NORMALISED, leakage=0.5, centre=CENTRE),
    "error leakage": WithErrorLeakage(law=NORMALISED, leakage=2.0, centre=CENTRE),
}
BANDWIDTH = 10.0


def compiled(law):
    """(rate, confined) of a law for five gains, as functions of numbers."""
    values = {name: np.ravel(v) for name, v in law.parameters(5).items()}
    symbols = {name: ca.SX(v) for name, v in values.items()}
    gains, regressor, error = ca.SX.sym("gains", 5), ca.SX.sym("φ", 5), ca.SX.sym("ε")
    signals = AdaptationSignals(
        gains=gains, regressor=regressor, error=error, bandwidth=ca.SX(BANDWIDTH)
    )
    rate = ca.Function("rate", [gains, regressor, error], [law.rate(symbols, signals)])
    confined = ca.Function("confined", [gains], [law.confined(symbols, gains)])
    return (
        lambda θ, φ, ε: rate(θ, φ, ε).full().ravel(),
        lambda θ: confined(θ).full().ravel(),
    )


FUNCTIONS = {name: compiled(law) for name, law in LAWS.items()}
INSIDE = {name: compiled(law.law)[0] for name, law in LAWS.items()}

fractions = arrays(float, 5, elements=st.sampled_from([0.0, 0.3, 0.5, 1.0]))
regressors = arrays(float, 5, elements=st.floats(-5, 5))
errors = st.floats(-3, 3)
LOWER, UPPER = np.array(BOX.lower), np.array(BOX.upper)


@settings(max_examples=80, deadline=None)
@given(at=fractions, truth=fractions, regressor=regressors, error=errors)
def test_projection_never_raises_v_and_points_inwards(at, truth, regressor, error):
    θ, θ0 = (LOWER + part * (UPPER - LOWER) for part in (at, truth))
    rate, inner = FUNCTIONS["projection"][0](θ, regressor, error), INSIDE["projection"]
    weighted = (θ - θ0) / np.array(GRADIENT.gain)
    assert weighted @ rate <= weighted @ inner(θ, regressor, error) + 1e-12
    assert np.all(rate[at == 0.0] >= 0.0)
    assert np.all(rate[at == 1.0] <= 0.0)
    strictly = (at > 0.0) & (at < 1.0)
    np.testing.assert_array_equal(rate[strictly], inner(θ, regressor, error)[strictly])


@given(arrays(float, 5, elements=st.floats(-50, 50)))
def test_projection_confines_to_the_nearest_point_of_the_box(gains):
    np.testing.assert_array_equal(FUNCTIONS["projection"][1](gains), np.clip(gains, LOWER, UPPER))


@settings(max_examples=80, deadline=None)
@given(
    gains=arrays(float, 5, elements=st.floats(-5, 5)),
    truth=fractions,
    regressor=regressors,
    disturbance=st.floats(-0.2, 0.2),
)
def test_dead_zone_never_raises_v_under_the_disturbance_it_is_made_for(
    gains, truth, regressor, disturbance
):
    error = -regressor @ (gains - truth) + disturbance
    rate = FUNCTIONS["dead zone"][0](gains, regressor, error)
    assert (gains - truth) / np.array(GRADIENT.gain) @ rate <= 1e-9
    if abs(error) <= 0.2:
        assert not rate.any()


def test_dead_zone_opens_gradually():
    rate = FUNCTIONS["dead zone"][0]
    just_beyond = rate(np.ones(5), np.ones(5), 0.2 + 1e-6)
    # A switch instead would jump to width times the gain and chatter at the border.
    assert 0.0 < np.abs(just_beyond).max() < 1e-4


def test_without_the_dead_zone_the_same_disturbance_raises_v():
    gains, regressor = np.full(5, 1.01), np.ones(5)
    error = -regressor @ (gains - 1.0) + 0.2
    assert (gains - 1.0) / np.array(GRADIENT.gain) @ INSIDE["dead zone"](
        gains, regressor, error
    ) > 0.0


@pytest.mark.parametrize(
    ("name", "bound"),
    [
        # The normalised law moves at most γ̂ω|ε|/(2√α): φ/(α + φ²) peaks at φ = √α.
        ("leakage", BANDWIDTH * 3.0 / (2 * np.sqrt(0.1)) / 0.5),
        ("error leakage", BANDWIDTH / (2 * np.sqrt(0.1)) / 2.0),
    ],
)
def test_leakage_bounds_what_the_worst_signal_can_do(name, bound):
    rate, inner = FUNCTIONS[name][0], INSIDE[name]
    drifting, held = np.array(CENTRE), np.array(CENTRE)
    regressor = np.full(5, np.sqrt(0.1 / 5))  # the worst: always the same sign, φᵀφ = α
    for _ in range(1500):
        held = held + 1e-2 * rate(held, regressor, 3.0)
        drifting = drifting + 1e-2 * inner(drifting, regressor, 3.0)
    distance = np.linalg.norm(held - CENTRE)
    assert distance <= bound * (1 + 1e-6)
    assert distance > 0.95 * bound  # and this signal does reach the bound
    assert np.linalg.norm(drifting - CENTRE) > 5 * bound


def test_wrappers_compose_from_the_inside_out():
    law = WithProjection(
        law=WithLeakage(law=WithDeadZone(law=NORMALISED, width=0.2), leakage=0.5, centre=CENTRE),
        box=BOX,
    )
    rate, confined = compiled(law)
    θ = np.array([1.9, 3.1, 1.0, 1.0, 0.9])
    np.testing.assert_allclose(rate(θ, np.ones(5), 0.1), 0.5 * (np.array(CENTRE) - θ), atol=1e-15)
    np.testing.assert_array_equal(confined(θ * 5), UPPER)


def test_misuse_is_refused():
    twice = WithDeadZone(law=WithDeadZone(law=GRADIENT, width=0.1), width=0.2)
    with pytest.raises(ParameterError, match="wrapped twice"):
        twice.parameters(5)
    with pytest.raises(ParameterError, match="more than"):
        WithProjection(law=NORMALISED, box=BOX).parameters(4)
    with pytest.raises(ParameterError, match="lower <= upper"):
        GainBox(lower=(1.0,), upper=(0.0,))
    with pytest.raises(ParameterError, match="leakage"):
        WithLeakage(law=GRADIENT, leakage=-1.0, centre=CENTRE)


DESIGN = design_rst(
    RSTSpecification(
        plant=ForcePlant(stiffness=800.0, velocity_gain=50.0),
        reference_model=ReferenceModel(bandwidth=500.0, damping=1.0),
        observer=first_order_observer(500.0),
    )
)


def noisy_gains(law, *, duration=20.0, sampled=False):
    """Gains over time on a resting heart, at zero force, under 50 mN of sensor noise."""
    step = build_step(
        AdaptiveRST(
            design=DESIGN,
            prefilter=ReferenceModel(bandwidth=50.0, damping=1.0),
            law=law,
            feedforward=ModelInverse(),
            bias_force=0.0,
            initial_gains=nominal_gains(DESIGN),
            time_domain=Discrete(1e-3) if sampled else Continuous(),
        )
    )
    plant = {"velocity_gain": 50.0, "stiffness": 800.0}
    loop = (
        build_sampled_axis_loop(step, period=1e-3, delay=0, **plant)
        if sampled
        else build_axis_loop(step, **plant)
    )
    still = PiecewisePolynomial(
        breakpoints=np.array([0.0, duration]), coefficients=np.zeros((1, 1, 1))
    )
    inputs = axis_inputs(
        step,
        heart=still,
        reference=constant_force(0.0).piecewise(duration),
        noise=white_noise(rms=0.05, period=1e-3, duration=duration, seed=5),
        end=duration,
    )
    settings_ = RunSettings(duration=duration, step=2e-4, record_period=0.01)
    return simulate_axis(loop, inputs=inputs, settings=settings_)["adapted_gains"][:, :5]


NOMINAL = nominal_gains(DESIGN)
TIGHT = GainBox.around(NOMINAL, fraction=0.1)


@pytest.mark.parametrize("sampled", [False, True])
def test_noise_alone_moves_the_plain_law_out_of_a_box_that_projection_keeps(sampled):
    law = NormalisedGradientLaw(gain=1.0, alpha=0.1)
    free = noisy_gains(law, sampled=sampled)
    kept = noisy_gains(WithProjection(law=law, box=TIGHT), sampled=sampled)
    outside = (free < TIGHT.lower) | (free > TIGHT.upper)
    assert outside.any()
    assert np.all((kept >= TIGHT.lower) & (kept <= TIGHT.upper))
    assert np.abs(kept - NOMINAL).max() > 0.01  # it still adapts


@pytest.mark.parametrize(
    "wrap",
    [
        lambda law: WithLeakage(law=law, leakage=1.0, centre=NOMINAL),
        lambda law: WithErrorLeakage(law=law, leakage=30.0, centre=NOMINAL),
        lambda law: WithDeadZone(law=law, width=0.3),
    ],
    ids=["leakage", "error leakage", "dead zone"],
)
def test_the_other_wrappers_stop_the_drift_too(wrap):
    law = NormalisedGradientLaw(gain=1.0, alpha=0.1)
    plain = np.abs(noisy_gains(law)[-1] - NOMINAL).max()
    robust = np.abs(noisy_gains(wrap(law))[-1] - NOMINAL).max()
    assert robust < 0.5 * plain
