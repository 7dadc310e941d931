"""The adaptive RST step against a plain NumPy loop, linear theory and the textbook's example."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from mrac_design.controller.adaptation import GradientLaw, NormalisedGradientLaw
from mrac_design.controller.adaptive import AdaptiveRST, build_step, nominal_gains
from mrac_design.controller.reference import DirectReference, ModelInverse
from mrac_design.controller.rivals.fixed_rst import FixedRST, fixed_rst
from mrac_design.controller.rivals.linear import build_linear_step
from mrac_design.controller.step import ControllerStep
from mrac_design.design import ReferenceModel, RSTSpecification, design_rst, first_order_observer
from mrac_design.errors import ParameterError
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Continuous, Discrete
from tests.oracles.adaptive_rst import AxisLoop

PAPER = design_rst(
    RSTSpecification(
        plant=ForcePlant(stiffness=800.0, velocity_gain=50.0),
        reference_model=ReferenceModel(bandwidth=500.0, damping=1.0),
        observer=first_order_observer(500.0),
    )
)
BOOK = design_rst(
    RSTSpecification(
        plant=ForcePlant(stiffness=2.0, velocity_gain=1.0),
        reference_model=ReferenceModel(bandwidth=1.0, damping=0.7),
        observer=first_order_observer(2.0),
    )
)


RESONANT = design_rst(
    RSTSpecification(
        plant=ForcePlant(stiffness=800.0, velocity_gain=20.0),
        reference_model=ReferenceModel(bandwidth=300.0, damping=1.2),
        observer=(1.0, 250.0, 30000.0, 1.5e6),
        internal_model=(1.0, 11.0, 1400.0),
    )
)
INTEGRAL = design_rst(
    RSTSpecification(
        plant=ForcePlant(stiffness=800.0, velocity_gain=20.0),
        reference_model=ReferenceModel(bandwidth=300.0, damping=1.0),
        observer=(1.0, 350.0, 40000.0),
        internal_model=(1.0, 0.0),
    )
)
PREFILTER = ReferenceModel(bandwidth=50.0, damping=1.0)
DEGREES = pytest.mark.parametrize("design", [PAPER, INTEGRAL, RESONANT], ids=["1", "2", "3"])


def controller(design=PAPER, **changes) -> AdaptiveRST:
    base = AdaptiveRST(
        design=design,
        prefilter=None,
        law=NormalisedGradientLaw(gain=1.0, alpha=0.1),
        feedforward=DirectReference(),
        bias_force=0.0,
        initial_gains=nominal_gains(design),
        time_domain=Continuous(),
    )
    return replace(base, **changes)


def advance(step: ControllerStep, x, force, reference):
    command = step.command(x, force, reference, step.parameter_values)
    following, signals = step.advance(x, force, reference, command, step.parameter_values)
    return float(command), following.full().ravel(), step.signals.split(signals.full().ravel())


def simulate(step: ControllerStep, plant: ForcePlant, reference, times, tolerance=1e-9, push=0.0):
    """Plant y'' = −K2 y' + b0 (u + push) from rest, the reference held between `times`."""
    n = step.state.size

    def rhs(_, x, level):
        command, following, _ = advance(step, x[2:], x[0], level)
        acceleration = -plant.velocity_gain * x[1] + plant.b0 * (command + push)
        return np.concatenate([[x[1], acceleration], following])

    start = step.equilibrium(0.0, step.parameter_values).full().ravel()
    rows = [np.concatenate([[0.0, 0.0], start])]
    assert rows[0].size == n + 2
    for left, right in pairwise(times):
        level = reference(0.5 * (left + right))
        solution = solve_ivp(
            rhs, (left, right), rows[-1], args=(level,), method="DOP853",
            rtol=tolerance, atol=tolerance,
        )  # fmt: skip
        rows.append(solution.y[:, -1])
    return np.array(rows)


def gains_of(step: ControllerStep, rows):
    return step.state.split(rows[:, 2:])["gains"]


@DEGREES
@pytest.mark.parametrize("alpha", [None, 0.1])
def test_step_is_the_plain_numpy_loop(alpha, design):
    """Scaled generated step against the SI formulas, through a step of the force."""
    gamma_hat = 1.0
    law = (
        GradientLaw(gain=gamma_hat)
        if alpha is None
        else NormalisedGradientLaw(gain=gamma_hat, alpha=alpha)
    )
    specification = design.specification
    model, plant = specification.reference_model, specification.plant
    oracle = AxisLoop(
        b0=plant.b0, k2=plant.velocity_gain, omega=model.bandwidth, xi=model.damping,
        observer=specification.observer, internal_model=specification.internal_model,
        scaling=np.array(design.scaling),
        gamma=gamma_hat * model.bandwidth * plant.b0 * design.scaling**2, alpha=alpha,
    )  # fmt: skip
    # Start off the solution, or there would be nothing to adapt.
    start, count = 0.8 * design.scaled_parameters, len(design.parameters)
    step = build_step(controller(design, law=law, initial_gains=tuple(start)))
    times = np.array([0.0, 0.01, 0.02, 0.05])
    reference = lambda t: 1.5 if t < 0.02 else 1.0  # noqa: E731
    ours = simulate(step, plant, reference, times, tolerance=1e-11)
    plain = oracle.run(theta=0.8 * design.parameters, uc=reference, times=times, tolerance=1e-11)
    # Both integrated to 1e-11; forces are of order 1 N, gains of order 1.
    np.testing.assert_allclose(ours[:, 0], plain[:, 0], atol=1e-8)
    gains = gains_of(step, ours)[:, :count]
    np.testing.assert_allclose(gains * design.scaling, plain[:, oracle.gains_at :], rtol=1e-7)
    assert np.abs(gains[-1] - start).max() > 1e-3
    wrong = []
    for row, state, t in zip(ours[1:], plain[1:], times[1:], strict=True):
        # Without disturbance ε is nothing but the gains' error: ε = b0 φᵀ(θ⁰ − θ).
        _, phi, error = oracle.signals(state, reference(t - 1e-9))
        wrong.append(plant.b0 * phi @ (design.parameters - state[oracle.gains_at :]))
        found = advance(step, row[2:], row[0], reference(t - 1e-9))[2]["augmented_error"]
        assert error == pytest.approx(wrong[-1], abs=1e-8)
        assert float(found[0]) == pytest.approx(wrong[-1], abs=1e-8)
    assert np.abs(wrong).max() > 1e-3


def test_zero_gain_is_the_frozen_rst_controller():
    """u = −(S/R) y + (T/R) uc, computed by python-control."""
    step = build_step(controller(law=NormalisedGradientLaw(gain=0.0, alpha=0.1)))
    t = np.linspace(0, 0.1, 2001)
    y, uc = np.sin(130 * t), np.cos(70 * t) - 1
    through_y = control.forced_response(control.tf(PAPER.S, PAPER.R), t, y).outputs
    through_uc = control.forced_response(control.tf(PAPER.T, PAPER.R), t, uc).outputs
    start = step.equilibrium(0.0, step.parameter_values).full().ravel()
    solution = solve_ivp(
        lambda s, x: advance(step, x, np.sin(130 * s), np.cos(70 * s) - 1)[1],
        (0, t[-1]), start, t_eval=t[::100], method="DOP853", rtol=1e-9, atol=1e-12,
    )  # fmt: skip
    ours = [advance(step, x, y[100 * i], uc[100 * i])[0] for i, x in enumerate(solution.y.T)]
    expected = through_uc - through_y
    # forced_response holds linear between samples of 50 µs: about (130 h)²/8 of the signal.
    np.testing.assert_allclose(ours, expected[::100], atol=2e-5 * np.abs(expected).max())


def fixed_of(design, domain):
    """The controller with fixed gains, (rows, command) over [state, y, r, u], and its rest."""
    fixed = fixed_rst(
        FixedRST(design=design, prefilter=PREFILTER, feedforward=ModelInverse(), time_domain=domain)
    )
    step = build_linear_step(fixed)
    return fixed.matrices(), step.equilibrium(1.0, step.parameter_values).full().ravel()


@DEGREES
def test_zero_gain_is_the_fixed_controller_sample_by_sample(design):
    """Two realisations of the same R, S, T: one filter a signal against one observer for all."""
    step = build_step(
        controller(
            design,
            law=NormalisedGradientLaw(gain=0.0, alpha=0.1),
            prefilter=PREFILTER,
            feedforward=ModelInverse(),
            time_domain=Discrete(1e-3),
        )
    )
    (rows, command_row), state = fixed_of(design, Discrete(1e-3))
    x = step.equilibrium(1.0, step.parameter_values).full().ravel()
    rng = np.random.default_rng(3)
    ours, expected = [], []
    for force, reference in 1 + 0.3 * rng.normal(size=(400, 2)):
        command, x, _ = advance(step, x, force, reference)
        columns = np.concatenate([state, [force, reference, 0.0]])
        columns[-1] = command_row @ columns
        state = rows @ columns
        ours.append(command)
        expected.append(columns[-1])
    # Rounding, over some hundred samples of the controllers' memory.
    np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-10 * np.abs(expected).max())
    assert np.abs(expected).max() > 10.0


@DEGREES
def test_zero_gain_is_the_fixed_controller_in_continuous_time(design):
    step = build_step(
        controller(
            design,
            law=NormalisedGradientLaw(gain=0.0, alpha=0.1),
            prefilter=PREFILTER,
            feedforward=ModelInverse(),
        )
    )
    (rows, command_row), state = fixed_of(design, Continuous())
    n = rows.shape[0]
    closed = rows[:, :-1] + np.outer(rows[:, -1], command_row[:-1])
    x = step.equilibrium(1.0, step.parameter_values).full().ravel()
    rng = np.random.default_rng(4)
    ours, expected, span = [], [], 4e-3
    for force, reference in 1 + 0.3 * rng.normal(size=(12, 2)):
        ours.append(advance(step, x, force, reference)[0])
        expected.append(command_row[:-1] @ [*state, force, reference])
        x = solve_ivp(
            lambda _, x, at=(force, reference): advance(step, x, *at)[1],
            (0, span), x, method="DOP853", rtol=1e-10, atol=1e-12,
        ).y[:, -1]  # fmt: skip
        held = np.vstack([closed, np.zeros((2, n + 2))])
        state = (expm(span * held) @ [*state, force, reference])[:n]
    # The filters' states, integrated to 1e-10, times gains some thousand times their size.
    np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize(("bias", "gain"), [(0.0, 0.0), (1.0, 1.0)], ids=["fixed", "adapting"])
def test_a_bias_does_what_an_integrator_in_r_would(bias, gain):
    """A constant push leaves b0 R(0)/(Ao Am)(0) of it as force, or nothing once the bias has it."""
    push, law = 4.0, NormalisedGradientLaw(gain=gain, alpha=0.1)
    plant = RESONANT.specification.plant
    left = plant.b0 * RESONANT.R[-1] / np.prod(-RESONANT.closed_loop_poles).real * push
    assert left > 5e-3
    times = np.linspace(0.0, 1.5, 4)
    step = build_step(controller(RESONANT, law=law, bias_force=bias))
    end = simulate(step, plant, lambda t: 0.0, times, tolerance=1e-9, push=push)[-1, 0]
    assert end == pytest.approx(left if bias == 0.0 else 0.0, abs=1e-3 * left)
    # R with a root at 0 needs no bias.
    step = build_step(controller(INTEGRAL, law=NormalisedGradientLaw(gain=0.0, alpha=0.1)))
    still = simulate(step, plant, lambda t: 0.0, times, tolerance=1e-9, push=push)[-1, 0]
    assert still == pytest.approx(0.0, abs=1e-3 * left)


def test_lyapunov_function_never_increases_without_disturbance():
    """V = ½ θ̃ᵀΓ⁻¹θ̃ has dV/dt = −ε²/b0 for the plain law when d = 0."""
    start = tuple(0.7 * PAPER.scaled_parameters)
    step = build_step(controller(law=GradientLaw(gain=0.5), initial_gains=start))
    times = np.linspace(0, 0.3, 61)
    rows = simulate(step, PAPER.specification.plant, lambda t: 1 + (t > 0.15), times)
    error = gains_of(step, rows)[:, :5] - PAPER.scaled_parameters
    value = (error**2).sum(axis=1)
    # The augmented error identity holds once initial filter states agree; both start at zero.
    assert (np.diff(value) <= 1e-9).all()
    assert value[-1] < value[0] - 1e-3


def test_book_example_5_14():
    """[AW] Example 5.14: the book gives poles −1.95 and (0.84, 0.78) at t = 150 s.

    The parameters stay far from their true values, as the book says. Γ is the identity there.
    """
    np.testing.assert_allclose(BOOK.parameters, [0.4, 0.7, 1, 0.5, 1], rtol=1e-12)
    scaled_gain = 1 / (1.0 * 2.0 * BOOK.scaling**2)
    law = GradientLaw(gain=(*scaled_gain, 0.0))
    step = build_step(controller(BOOK, law=law, initial_gains=(0.0,) * 5))
    square = lambda t: 1.0 if (t // 25) % 2 == 0 else -1.0  # noqa: E731
    rows = simulate(step, BOOK.specification.plant, square, np.arange(0, 151, 25.0), tolerance=1e-7)
    r1, s0, s1, _, _ = gains_of(step, rows)[-1, :5] * BOOK.scaling + [2.0, 0, 0, 0, 0]
    poles = np.roots(np.polymul([1, 1, 0], [1, r1]) + np.array([0, 0, 2 * s0, 2 * s1]))
    real = poles[np.abs(poles.imag) < 1e-9].real
    pair = poles[poles.imag > 1e-9]
    assert real == pytest.approx([-1.95], rel=0.1)
    assert abs(pair[0]) == pytest.approx(0.84, rel=0.1)
    assert -pair[0].real / abs(pair[0]) == pytest.approx(0.78, rel=0.1)
    assert np.abs(gains_of(step, rows)[-1, :5] * BOOK.scaling - BOOK.parameters).max() > 0.2


def test_adaptation_rejects_a_constant_disturbance_only_under_force():
    """Hidden integral action: e/d = S_d (1 − (ω²/Am) λ/(p + λ)), λ ∝ F0² vanishes with F0."""
    rates = []
    for force in (0.0, 1.0):
        step = build_step(controller(law=GradientLaw(gain=1.0)))
        settled = step.equilibrium(force, step.parameter_values).full().ravel()
        _, following, _ = advance(step, settled, force + 0.01, force)
        rates.append(np.abs(step.state.split(following)["gains"]).max())
    assert rates[0] == 0.0
    # φ̂ = F0 in the entries of s1 and t1; ε = 0.01 N: dθ̂/dt = γ̂ ω F0 ε.
    assert rates[1] == pytest.approx(500 * 0.01, rel=1e-9)


def test_model_inverse_makes_the_model_output_the_desired_force():
    prefilter = ReferenceModel(bandwidth=50.0, damping=1.0)
    step = build_step(controller(feedforward=ModelInverse(), prefilter=prefilter))
    rows = simulate(
        step, PAPER.specification.plant, lambda t: 1.0, np.linspace(0, 0.2, 11), tolerance=1e-10
    )
    states = step.state.split(rows[:, 2:])
    # ym and Fd obey the same equation from the same start.
    np.testing.assert_allclose(states["model"][:, 1], states["prefilter"][:, 1], atol=1e-9)
    assert states["prefilter"][-1, 1] > 0.99


@pytest.mark.parametrize("domain", [Continuous(), Discrete(1e-3)])
def test_equilibrium_is_at_rest(domain):
    step = build_step(
        controller(time_domain=domain, prefilter=ReferenceModel(bandwidth=50.0, damping=1.0))
    )
    settled = step.equilibrium(1.5, step.parameter_values).full().ravel()
    command, following, signals = advance(step, settled, 1.5, 1.5)
    rest = settled if isinstance(domain, Discrete) else np.zeros_like(settled)
    # Rounding of sums of terms of order ω² y / b0.
    assert abs(command) < 1e-9
    np.testing.assert_allclose(following, rest, atol=1e-9)
    assert float(signals["augmented_error"][0]) == pytest.approx(0.0, abs=1e-12)


def test_discrete_filters_are_the_continuous_ones_under_a_hold():
    period = 1e-3
    sampled = build_step(controller(time_domain=Discrete(period)))
    continuous = build_step(controller(law=NormalisedGradientLaw(gain=0.0, alpha=0.1)))
    rng = np.random.default_rng(1)
    x = rng.normal(size=sampled.state.size)
    force, reference, applied = rng.normal(size=3)
    following = sampled.advance(x, force, reference, applied, sampled.parameter_values)[0]
    solution = solve_ivp(
        lambda _, s: continuous.advance(
            s, force, reference, applied, continuous.parameter_values
        )[0].full().ravel(),
        (0, period), x, method="DOP853", rtol=1e-12, atol=1e-12,
    )  # fmt: skip
    ours, exact = (sampled.state.split(v) for v in (following.full().ravel(), solution.y[:, -1]))
    for name in ("filtered_command", "filtered_force", "filtered_reference", "model"):
        np.testing.assert_allclose(ours[name], exact[name], rtol=1e-8, atol=1e-10, err_msg=name)


def test_bias_regressor_learns_a_constant_push_without_force():
    """At F0 = 0 only the bias can adapt; without it the gains see nothing."""
    still = build_step(controller())
    biased = build_step(controller(bias_force=1.0))
    for step, moves in ((still, False), (biased, True)):
        settled = step.equilibrium(0.0, step.parameter_values).full().ravel()
        gains = step.state.split(advance(step, settled, 0.01, 0.0)[1])["gains"]
        assert bool(np.abs(gains).max() > 0) is moves
        assert not np.abs(gains[:5]).any()


@pytest.mark.parametrize(
    ("build", "name"),
    [
        (lambda: GradientLaw(gain=-1.0), "adaptation gain"),
        (lambda: NormalisedGradientLaw(gain=1.0, alpha=0.0), "alpha"),
        (lambda: controller(bias_force=-1.0), "bias force"),
        (lambda: controller(initial_gains=(1.0, 2.0)), "initial gains"),
    ],
)
def test_impossible_numbers_are_refused_by_name(build, name):
    with pytest.raises(ParameterError, match=name):
        build()
