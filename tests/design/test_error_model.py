from __future__ import annotations

import numpy as np
import pytest
from flint import fmpq, fmpq_poly
from scipy.integrate import solve_ivp

from mrac_design.design import (
    AugmentedError,
    AugmentedErrorUnknownGain,
    CancelWellDamped,
    DirectError,
    ErrorModel,
    FollowModel,
    KeepZeros,
    PolePlacement,
    ReferenceModel,
    RSTSpecification,
    UnitStaticGain,
    WellDampedRegion,
    design_rst_exact,
    first_order_observer,
    place_poles_exact,
    relative_degree_two_error_model,
    unfiltered_error_model,
)
from mrac_design.errors import DegreeConditionError, NotCausalError, ParameterError
from mrac_design.plant import ForcePlant, Process
from mrac_design.polynomials import exact_polynomial
from mrac_design.time_domain import Continuous, Discrete


def poly(*values):
    return exact_polynomial(values)


EXAMPLE = design_rst_exact(
    RSTSpecification(
        plant=ForcePlant(stiffness=2.0, velocity_gain=1.0),
        reference_model=ReferenceModel(bandwidth=1.0, damping=0.7),
        observer=first_order_observer(2.0),
    )
)


def cancelling_design():
    """Third-order process with a well-damped zero: relative degree two."""
    return place_poles_exact(
        PolePlacement(
            process=Process.of(A=[1, 2, 3, 1], B=[4, 12], domain=Continuous()),
            Am=poly(1, 5) ** 3,
            Ao=poly(1, 6),
            zeros=CancelWellDamped(region=WellDampedRegion(damping=0.7, decay_rate=0.0)),
            tracking=FollowModel(Bm=poly(2, 125)),
        )
    )


def test_example_5_14():
    model = unfiltered_error_model(EXAMPLE)
    np.testing.assert_array_equal(model.ideal_parameters, [0.4, 0.7, 1.0, 0.5, 1.0])
    assert [entry.parameter for entry in model.regressor] == ["r1'", "s0", "s1", "t0", "t1"]
    assert [entry.sign for entry in model.regressor] == [1, 1, 1, -1, -1]
    assert [entry.power for entry in model.regressor] == [0, 1, 0, 1, 0]
    assert model.transfer == (poly(2), poly(1))
    assert model.needs_augmentation
    assert model.relative_degree == 0


def test_relative_degree_two_variant():
    model = relative_degree_two_error_model(EXAMPLE, zero=fmpq(1, 2))
    assert model.transfer == (poly(2, 1), poly(1, "1.4", 1))
    assert model.relative_degree == 1
    assert model.P == model.Q
    system = model.transfer_function()
    assert system(1j) == pytest.approx((2j + 1) / (1.4j), rel=1e-14)
    assert r"\dfrac{2\,p + 1}{p^{2}" in model._repr_latex_()


@pytest.mark.parametrize("design", [EXAMPLE, cancelling_design()], ids=["force", "cancelling"])
def test_model_holds_as_an_identity_of_polynomials(design):
    placement = design.specification
    P2 = placement.Ao * placement.split.cancelled
    Q, P1 = poly(1, 3) ** (placement.Ao * placement.Am).degree(), poly(1, 7) ** 4
    model = ErrorModel(design=design, Q=Q, P1=P1, P2=P2)
    assert all(part.is_zero() for part in model.remainders)
    # The same through the regressor: P2 + Σ θ⁰ p^k over the entries of u gives R, and so on.
    u, y, uc = fmpq_poly([0]), fmpq_poly([0]), fmpq_poly([0])
    for entry in model.regressor:
        term = entry.ideal * fmpq_poly([0, 1]) ** entry.power
        match entry.signal.value:
            case "u":
                u += term
            case "y":
                y += term
            case "uc":
                uc += term
    assert (model.P2 + u, y, uc) == (design.R, design.S, design.T)
    # A disturbance d at the output, controller at θ⁰: e = A R/(Ao Am B⁺) d, ef = Q/P of that.
    numerator, denominator = model.disturbance_transfer
    A, R = placement.process.A, design.R
    assert numerator * model.P * placement.closed_loop == denominator * Q * A * R


def test_degree_conditions():
    placement = EXAMPLE.specification
    P2, Am = placement.Ao, placement.Am

    def model(**changes):
        given = {"Q": P2 * Am, "P1": Am, "P2": P2}
        return ErrorModel(design=EXAMPLE, **{**given, **changes})

    with pytest.raises(DegreeConditionError, match=r"relative degree one: .* 2, got 1"):
        model(Q=P2)
    with pytest.raises(NotCausalError, match="deg Q = 4 > deg Ao Am = 3"):
        model(Q=P2 * P2 * Am)
    with pytest.raises(DegreeConditionError, match=r"degree of P1 .* 2, got 1"):
        model(P1=poly(1, 1))
    with pytest.raises(ParameterError, match="degree of P2 = 2: must equal deg R = 1"):
        model(P2=P2 * P2)
    with pytest.raises(ParameterError, match=r"P1 .*stable"):
        model(P1=poly(1, 0, 0))
    with pytest.raises(ParameterError, match=r"P2 .*stable"):
        model(P2=poly(1, -1))
    with pytest.raises(ParameterError, match="Q = 0"):
        model(Q=fmpq_poly([0]))
    normalised = model(P1=3 * Am)
    assert (normalised.P1 - Am).is_zero()


def test_processes_the_theory_does_not_cover_are_refused():
    kept = place_poles_exact(
        PolePlacement(
            process=Process.of(A=[1, 3, 2], B=[1, -4], domain=Continuous()),
            Am=poly(1, 6, 25),
            Ao=poly(1, 10),
            zeros=KeepZeros(),
            tracking=UnitStaticGain(),
        )
    )
    with pytest.raises(ParameterError, match="kept process zeros = 4"):
        unfiltered_error_model(kept)
    sampled = place_poles_exact(
        PolePlacement(
            process=Process.of(A=[1, "-0.5"], B=[1], domain=Discrete(1.0)),
            Am=poly(1, "-0.2"),
            Ao=poly(1),
            zeros=KeepZeros(),
            tracking=UnitStaticGain(),
        )
    )
    with pytest.raises(ParameterError, match="time domain"):
        unfiltered_error_model(sampled)


def test_schemes_state_what_has_to_be_positive_real():
    model = relative_degree_two_error_model(EXAMPLE, zero=fmpq(1))
    assert AugmentedError(model=model).strictly_positive_real == model.transfer
    assert DirectError(model=model).strictly_positive_real == model.transfer
    unknown = AugmentedErrorUnknownGain(model=model, initial_gain=1.5)
    assert unknown.strictly_positive_real == (poly(1, 1), poly(1, "1.4", 1))
    for scheme in (AugmentedError(model=model), DirectError(model=model), unknown):
        assert r"\dot\theta &= \Gamma" in scheme._repr_latex_()


def test_schemes_refuse_what_they_cannot_run():
    full = unfiltered_error_model(EXAMPLE)
    with pytest.raises(ParameterError, match="degree of P1 = 2"):
        DirectError(model=full)
    for gain in (0.0, -1.0, np.nan):
        with pytest.raises(ParameterError, match="initial gain"):
            AugmentedErrorUnknownGain(model=full, initial_gain=gain)
    negative = place_poles_exact(
        PolePlacement(
            process=Process.of(A=[1, 1, 0], B=-2, domain=Continuous()),
            Am=poly(1, 2, 1),
            Ao=poly(1, 2),
            zeros=KeepZeros(),
            tracking=UnitStaticGain(),
        )
    )
    with pytest.raises(ParameterError, match="gain b0 = -2"):
        AugmentedError(model=unfiltered_error_model(negative))


class Axis:
    """Example 5.14 with any of the schemes, written out from the book's equations in NumPy.

    States: y, y', ym, ym', xu, xy, xc, then θ (5), b̂0, then z1, z2 of 1/P1 for xu, xy, xc and of
    G's controllable form, driven by φᵀ(θ⁰ − θ).
    """

    b0, a, ao, theta0 = 2.0, 1.0, 2.0, np.array([0.4, 0.7, 1.0, 0.5, 1.0])
    c, gamma = 0.5, 1.0

    def __init__(self, scheme):
        self.scheme = scheme

    def run(self, end=20.0):
        start = np.zeros(21)
        start[12] = 0.7
        return solve_ivp(
            self.slope, (0.0, end), start, rtol=1e-10, atol=1e-12, dense_output=False, max_step=0.05
        ).y

    def signals(self, x, uc):
        y, _, ym, _, xu, xy, xc = x[:7]
        theta, gain = x[7:12], x[12]
        filtered = np.array([xu, y - self.ao * xy, xy, -(uc - self.ao * xc), -xc])  # P1 φ
        e = y - ym
        if self.scheme == "direct":
            # P1 = p + c acts on xu, xy, xc: φ from the first-order filters x[13:18].
            phi = x[13:18]
            return theta, gain, filtered, phi, e, 0.0, e
        zu1, zu2, zy1, zy2, zc1, zc2 = x[13:19]
        phi = np.array([zu2, zy1, zy2, -zc1, -zc2])
        eta = -((zu1 + self.ao * zu2) + phi @ theta)
        known = self.b0 if self.scheme == "augmented" else gain
        return theta, gain, filtered, phi, e, eta, e + known * eta

    def slope(self, t, x):
        uc = np.sin(0.7 * t) + 0.5 * np.cos(2.1 * t) + 1.0
        theta, _, filtered, phi, e, eta, error = self.signals(x, uc)
        u = -theta @ filtered
        if self.scheme == "direct":
            u -= self.gamma * (phi @ phi) * e
        y, yd, ym, ymd, xu, xy, xc = x[:7]
        d = np.zeros_like(x)
        d[:7] = [
            yd, self.b0 * u - self.a * yd, ymd, uc - 1.4 * ymd - ym,
            u - self.ao * xu, y - self.ao * xy, uc - self.ao * xc,
        ]  # fmt: skip
        d[7:12] = self.gamma * phi * error
        if self.scheme == "unknown gain":
            d[12] = -self.gamma * eta * error
        if self.scheme == "direct":
            d[13:18] = filtered - self.c * phi
            g1, g2 = x[19:21]
            d[19:21] = [-1.4 * g1 - g2 + phi @ (self.theta0 - theta), g1]
        else:
            for k, source in enumerate((xu, xy, xc)):
                z1, z2 = x[13 + 2 * k : 15 + 2 * k]
                d[13 + 2 * k : 15 + 2 * k] = [source - 1.4 * z1 - z2, z1]
        return d


@pytest.mark.parametrize("scheme", ["augmented", "unknown gain", "direct"])
def test_error_models_hold_while_the_parameters_move(scheme):
    """The claim each scheme rests on, along an adaptation from θ = 0 with Q, P1, P2 as stated."""
    axis = Axis(scheme)
    states = axis.run()
    assert np.abs(states[7:12, -1]).max() > 0.1  # it did adapt
    worst = size = 0.0
    for x in states.T[::20]:
        theta, gain, _, phi, _, eta, error = axis.signals(x, 0.0)
        mismatch = phi @ (axis.theta0 - theta)
        if scheme == "direct":
            g1, g2 = x[19:21]
            claimed = axis.b0 * (g1 + axis.c * g2)  # G = b0 (p + c)/Am
        elif scheme == "augmented":
            claimed = axis.b0 * mismatch
        else:
            claimed = axis.b0 * mismatch - (axis.b0 - gain) * eta
        worst, size = max(worst, abs(error - claimed)), max(size, abs(error))
    assert size > 0.05
    # The integrator's tolerance, 1e-10, over 20 s.
    assert worst < 1e-7
