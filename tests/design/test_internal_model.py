"""RST designs with an internal model in R: an integrator, a resonance."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from mrac_design.design import ReferenceModel, RSTSpecification, design_rst, design_rst_exact
from mrac_design.errors import ParameterError
from mrac_design.plant import ForcePlant
from tests.oracles import diophantine_rational as oracle

INTEGRATOR = (1.0, 0.0)


def specification(K2=50.0, xi=1.0, observer=(1.0, 1080.0, 360000.0), internal_model=INTEGRATOR):
    return RSTSpecification(
        plant=ForcePlant(stiffness=800.0, velocity_gain=K2),
        reference_model=ReferenceModel(bandwidth=500.0, damping=xi),
        observer=observer,
        internal_model=internal_model,
    )


@pytest.mark.parametrize("K2", [0.0, 50.0, 123.4])
def test_the_controller_with_integrator_is_the_closed_form(K2):
    typed = specification(K2=K2, xi=0.7)
    exact = design_rst_exact(typed)
    r1, *s = oracle.force_rst_with_integrator(
        Fraction(repr(K2)), Fraction(800), Fraction(500), Fraction(7, 10), Fraction(1080),
        Fraction(360000),
    )  # fmt: skip
    assert exact.remainder.is_zero()
    assert [Fraction(int(c.p), int(c.q)) for c in exact.R.coeffs()] == [0, r1, 1]
    assert [Fraction(int(c.p), int(c.q)) for c in exact.S.coeffs()[::-1]] == s
    floating = design_rst(typed)
    assert floating.residual <= 1e-12
    np.testing.assert_allclose(floating.R, [1.0, float(r1), 0.0], rtol=1e-14)
    np.testing.assert_allclose(floating.S, [float(value) for value in s], rtol=1e-14)
    b0_T = np.array(floating.T) * 800.0
    np.testing.assert_allclose(b0_T, 500.0**2 * np.array([1, 1080.0, 360000.0]), rtol=1e-14)


def test_an_integrator_makes_the_disturbance_sensitivity_of_second_order_at_low_frequency():
    design = design_rst(specification())
    slow = np.abs(design.loop.disturbance_sensitivity()(1j * np.array([0.01, 0.1])))
    assert slow[1] / slow[0] == pytest.approx(100.0, rel=1e-3)
    assert design.loop.is_stable
    assert 0.0 < design.margins().gain_reduction_margin < 1.0
    assert "R(p)" in design._repr_latex_()


def test_a_resonance_blocks_its_frequency_and_places_all_poles():
    Ao = np.polymul([1.0, 60.0, 6400.0], [1.0, 150.0])
    design = design_rst(
        specification(K2=0.0, observer=tuple(Ao), internal_model=(1.0, 0.0, 40.0**2))
    )
    sensitivity = design.disturbance_sensitivity()
    # The zeros at ±40j are those of the polynomial, to its rounding.
    assert abs(sensitivity(40j)) < 1e-9 * abs(sensitivity(60j))
    assert [name for name, _, _ in design.coefficients] == [
        "r1", "s0", "s1", "s2", "s3", "t0", "t1", "t2", "t3"
    ]  # fmt: skip
    wanted = np.poly([*np.roots(Ao), -500.0, -500.0])
    np.testing.assert_allclose(np.poly(design.closed_loop_poles).real, wanted, rtol=1e-9)


def test_without_internal_model_the_adapted_pole_is_that_of_the_observer():
    plain = specification(observer=(1.0, 321.0), internal_model=(1.0,))
    assert plain.adapted_pole == plain.observer_pole == 321.0
    # (p + c) D = p² + 1080 p agrees with Ao but for its constant.
    assert specification().adapted_pole == 1080.0
    resonant = specification(observer=(1.0, 9.0, 27.0, 27.0), internal_model=(1.0, 2.0, 5.0))
    assert resonant.adapted_pole == 7.0


@pytest.mark.parametrize(
    ("observer", "internal_model", "message"),
    [
        ((1.0, -5.0), (1.0,), "left of 0"),
        ((1.0, np.nan), (1.0,), "finite"),
        ((2.0, 5.0), (1.0,), "begin with 1"),
        ((1.0, 5.0), INTEGRATOR, "degree 2"),
        ((1.0, 5.0, 6.0, 7.0), INTEGRATOR, "degree 2"),
        ((1.0, 5.0), (), "begin with 1"),
        (tuple(np.poly([-1.0] * 8)), (1.0,) + (0.0,) * 7, "degree 7 at most"),
    ],
)
def test_what_is_no_observer_or_internal_model_is_refused(observer, internal_model, message):
    with pytest.raises(ParameterError, match=message):
        specification(observer=observer, internal_model=internal_model)


def test_an_observer_of_higher_degree_has_no_single_pole():
    with pytest.raises(ParameterError, match="paper's p"):
        specification().observer_pole  # noqa: B018
