from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from mrac_design.design import (
    IntegralRSTSpecification,
    ReferenceModel,
    design_integral_rst,
    design_integral_rst_exact,
)
from mrac_design.errors import ParameterError
from mrac_design.plant import ForcePlant
from tests.oracles import diophantine_rational as oracle


def specification(Ks=800.0, K2=50.0, omega=500.0, xi=1.0, omega_o=600.0, xi_o=0.9):
    return IntegralRSTSpecification(
        plant=ForcePlant(stiffness=Ks, velocity_gain=K2),
        reference_model=ReferenceModel(bandwidth=omega, damping=xi),
        observer_bandwidth=omega_o,
        observer_damping=xi_o,
    )


@pytest.mark.parametrize("K2", [0.0, 50.0, 123.4])
def test_exact_design_is_the_closed_form(K2):
    typed = specification(K2=K2, xi=0.7)
    exact = design_integral_rst_exact(typed)
    omega_o, xi_o = Fraction(600), Fraction(9, 10)
    r1, *s = oracle.force_rst_with_integrator(
        Fraction(repr(K2)), Fraction(800), Fraction(500), Fraction(7, 10), 2 * xi_o * omega_o,
        omega_o**2,
    )  # fmt: skip
    assert exact.remainder.is_zero()
    assert [Fraction(int(c.p), int(c.q)) for c in exact.R.coeffs()] == [0, r1, 1]
    assert [Fraction(int(c.p), int(c.q)) for c in exact.S.coeffs()[::-1]] == s
    floating = design_integral_rst(typed)
    assert floating.residual <= 1e-12
    np.testing.assert_allclose(floating.R, [1.0, float(r1), 0.0], rtol=1e-14)
    np.testing.assert_allclose(floating.S, [float(value) for value in s], rtol=1e-14)
    b0_T = np.array(floating.T) * 800.0
    np.testing.assert_allclose(b0_T, 500.0**2 * np.array([1, 1080.0, 360000.0]), rtol=1e-14)


def test_disturbance_sensitivity_is_of_second_order_at_low_frequency():
    design = design_integral_rst(specification(K2=50.0))
    slow = np.abs(design.loop.disturbance_sensitivity()(1j * np.array([0.01, 0.1])))
    assert slow[1] / slow[0] == pytest.approx(100.0, rel=1e-3)
    assert design.loop.is_stable
    assert 0.0 < design.margins().gain_reduction_margin < 1.0
    assert "R(p)" in design._repr_latex_()


def test_poles_are_those_asked_for():
    design = design_integral_rst(specification(omega_o=500.0, xi_o=1.0))
    np.testing.assert_array_equal(design.closed_loop_poles, [-500.0] * 4)


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize("name", ["omega_o", "xi_o"])
def test_observer_must_be_stable(name, value):
    with pytest.raises(ParameterError, match="observer"):
        specification(**{name: value})
