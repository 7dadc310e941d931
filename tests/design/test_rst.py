from __future__ import annotations

import math
from fractions import Fraction

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrac_design.design import (
    FeedbackLoop,
    ReferenceModel,
    RSTSpecification,
    design_rst,
    design_rst_exact,
    diophantine_system,
    first_order_observer,
)
from mrac_design.errors import IllConditionedError, ParameterError
from mrac_design.plant import ForcePlant
from tests.oracles import diophantine_rational as oracle


def specification(Ks=800.0, K2=50.0, omega=500.0, xi=1.0, ao=500.0):
    return RSTSpecification(
        plant=ForcePlant(stiffness=Ks, velocity_gain=K2),
        reference_model=ReferenceModel(bandwidth=omega, damping=xi),
        observer=first_order_observer(ao),
    )


def decimals(least, most, *, places=4):
    """Floats people would type, and the decimal each means."""
    return st.integers(int(least * 10**places), int(most * 10**places)).map(
        lambda n: n / 10**places
    )


@settings(max_examples=150, deadline=None)
@given(
    Ks=decimals(0.1, 3000),
    K2_by_omega=decimals(0, 2),
    omega=decimals(1, 2000, places=2),
    xi=decimals(0.1, 3),
    ao_by_omega=decimals(0.1, 5),
)
def test_exact_design_is_the_closed_form(Ks, K2_by_omega, omega, xi, ao_by_omega):
    K2, ao = round(K2_by_omega * omega, 6), round(ao_by_omega * omega, 6)
    typed = specification(Ks, K2, omega, xi, ao)
    exact = design_rst_exact(typed)
    expected = oracle.force_rst(*(Fraction(repr(value)) for value in (K2, Ks, omega, xi, ao)))
    found = [exact.R[0], exact.S[1], exact.S[0], exact.T[1], exact.T[0]]
    assert [Fraction(int(value.p), int(value.q)) for value in found] == expected
    assert exact.remainder.is_zero()
    floating = design_rst(typed)
    assert floating.residual <= 1e-12
    np.testing.assert_allclose(
        [floating.r1, *floating.S, *floating.T],
        [float(value) for value in expected],
        rtol=1e-13,
        # s0 may nearly cancel; it is then as good as the terms it is made of.
        atol=1e-15 * float((omega + ao + K2) ** 2 / Ks + omega + ao + K2),
    )


def test_example_5_14_of_the_book():
    design = design_rst(specification(Ks=2.0, K2=1.0, omega=1.0, xi=0.7, ao=2.0))
    # One rounding each, except r1' = 2.4 − 2.
    np.testing.assert_allclose(design.parameters, [0.4, 0.7, 1.0, 0.5, 1.0], rtol=4e-16)


class TestNominal:
    design = design_rst(specification())

    def test_coefficients(self):
        # Integers and dyadic fractions throughout: exact in float64.
        np.testing.assert_array_equal(self.design.R, [1.0, 1450.0])
        np.testing.assert_array_equal(self.design.S, [846.875, 156250.0])
        np.testing.assert_array_equal(self.design.T, [312.5, 156250.0])
        assert self.design.residual == 0.0

    def test_scaled_parameters(self):
        np.testing.assert_allclose(
            self.design.scaled_parameters, [1.9, 2.71, 1.0, 1.0, 1.0], rtol=1e-15
        )
        np.testing.assert_array_equal(
            self.design.scaling * self.design.scaled_parameters, self.design.parameters
        )

    def test_poles_are_those_asked_for(self):
        np.testing.assert_array_equal(self.design.closed_loop_poles, [-500.0] * 3)
        assert self.design.loop.is_stable

    def test_margins(self):
        margins = self.design.margins()
        assert margins.crossover_frequency == pytest.approx(474.0, abs=0.5)
        assert math.degrees(margins.phase_margin) == pytest.approx(57.0, abs=0.5)
        assert margins.delay_margin == pytest.approx(2.1e-3, abs=0.05e-3)
        assert margins.gain_margin == math.inf

    def test_sensitivities(self):
        s = 1j * np.logspace(0, 4, 50)
        K2, Ks, r1 = 50.0, 800.0, 1450.0
        A, R = s * (s + K2), s + r1
        S, T = 846.875 * s + 156250.0, 312.5 * s + 156250.0
        closed = (s + 500.0) ** 3
        for system, expected in (
            (self.design.disturbance_sensitivity(), A * R / closed),
            (self.design.complementary_sensitivity(), Ks * S / closed),
            (self.design.control_sensitivity(), A * S / closed),
            (self.design.reference_transfer(), Ks * T / closed),
            (self.design.loop_transfer(), Ks * S / (A * R)),
            (self.design.loop.reference_to_control(), A * T / closed),
        ):
            # Evaluating (s + 500)³ in expanded form costs a few digits.
            np.testing.assert_allclose(system(s), expected, rtol=1e-12)
        sum_of_both = self.design.disturbance_sensitivity()(
            s
        ) + self.design.complementary_sensitivity()(s)
        np.testing.assert_allclose(sum_of_both, 1.0, rtol=1e-12)

    def test_reference_response_is_the_model(self):
        s = 1j * np.logspace(0, 4, 50)
        model = self.design.specification.reference_model.transfer_function()
        np.testing.assert_allclose(self.design.reference_transfer()(s), model(s), rtol=1e-12)

    def test_disturbance_response_does_not_depend_on_the_true_stiffness_at_low_frequency(self):
        """Heart motion Xh gives −Ks Xh S_d; its slope K2 r1/s1 has no Ks in it."""
        exact = self.design.loop
        for stiffness in (400.0, 800.0, 1200.0):
            true = ForcePlant(stiffness=stiffness, velocity_gain=50.0)
            loop = FeedbackLoop(process=true.process, R=exact.R, S=exact.S, T=exact.T)
            slope = stiffness * loop.disturbance_sensitivity()(1e-4j) / 1e-4j
            assert abs(slope) == pytest.approx(50.0 * 1450.0 / 156250.0, rel=1e-6)

    def test_printing(self):
        text = self.design._repr_markdown_()
        assert "| r1 | 1450 | 1/s |" in text
        assert "residual 0." in text
        assert "p + 1450" in self.design._repr_latex_()
        assert "56.7°" in self.design.margins()._repr_markdown_()


def test_velocity_loop_far_faster_than_the_model_is_judged():
    """K2 ≫ ω makes A R and b0 S cancel: the poles asked for are lost in the last digits of s0."""
    stiff = specification(Ks=0.1, K2=100.0, omega=0.01, xi=0.01, ao=0.01)
    with pytest.raises(IllConditionedError, match=r"cancel.*allow a larger residual"):
        design_rst(stiff)
    assert 1e-10 < design_rst(stiff, residual_limit=1e-6).residual < 1e-6
    assert design_rst_exact(stiff).remainder.is_zero()


def test_diophantine_system_can_be_read():
    system = diophantine_system(specification())
    np.testing.assert_array_equal(
        system.matrix, [[1, 0, 0, 0], [50, 1, 0, 0], [0, 50, 800, 0], [0, 0, 0, 800]]
    )
    np.testing.assert_array_equal(system.right_side, [1.0, 1500.0, 750e3, 125e6])


def test_agrees_with_python_control_about_the_closed_loop():
    design = design_rst(specification(Ks=1200.0, K2=20.0, omega=300.0, xi=0.8, ao=450.0))
    closed = control.feedback(design.loop_transfer(), 1)
    np.testing.assert_allclose(
        np.sort_complex(closed.poles()), np.sort_complex(design.closed_loop_poles), rtol=1e-9
    )


@pytest.mark.parametrize("value", [0.0, -500.0, math.nan, math.inf])
@pytest.mark.parametrize(
    ("argument", "name"), [("omega", "bandwidth ω"), ("xi", "damping ξ"), ("ao", "observer")]
)
def test_what_the_designer_chooses_must_be_positive(argument, name, value):
    with pytest.raises(ParameterError, match=rf"{name}.* = .*{value}.*: (must|needs)"):
        specification(**{argument: value})


def test_reference_model_through_python_control():
    model = ReferenceModel(bandwidth=500.0, damping=1.0)
    np.testing.assert_array_equal(model.polynomial, [1.0, 1000.0, 250000.0])
    assert ReferenceModel.from_transfer_function(model.transfer_function()) == model
    assert "250000" in model._repr_latex_()


@pytest.mark.parametrize(
    "system",
    [
        control.tf([1.0], [1.0, 2.0, 2.0]),
        control.tf([1.0, 1.0], [1.0, 2.0, 1.0]),
        control.tf([1.0], [1.0, 1.0]),
        control.tf([-1.0], [1.0, 2.0, -1.0]),
        control.tf([1.0], [1.0, 2.0, 1.0], dt=0.1),
    ],
)
def test_other_systems_are_not_reference_models(system):
    with pytest.raises(ParameterError, match="ω²"):
        ReferenceModel.from_transfer_function(system)
