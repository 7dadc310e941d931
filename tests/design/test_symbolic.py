from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from mrac_design.design import (
    ReferenceModel,
    RSTSpecification,
    design_rst_exact,
    first_order_observer,
    integral_rst_closed_form,
    integral_rst_sensitivities,
    rst_closed_form,
    rst_sensitivities,
)
from mrac_design.errors import ParameterError
from mrac_design.plant import ForcePlant
from tests.oracles import diophantine_rational as oracle

PLANT = ForcePlant(stiffness=812.5, velocity_gain=37.1)
MODEL = ReferenceModel(bandwidth=431.0, damping=0.83)
SIMPLE = RSTSpecification(plant=PLANT, reference_model=MODEL, observer=first_order_observer(617.3))
INTEGRAL = RSTSpecification(
    plant=PLANT,
    reference_model=MODEL,
    observer=(1.0, 1222.1, 308580.25),
    internal_model=(1.0, 0.0),
)
VALUES = {"K2": 37.1, "Ks": 812.5, "omega": 431.0, "xi": 0.83}


def test_closed_forms_take_the_values_of_the_exact_designs():
    simple = design_rst_exact(SIMPLE)
    found = rst_closed_form().at({**VALUES, "ao": 617.3})
    assert found == (simple.R[0], simple.S[1], simple.S[0], simple.T[1], simple.T[0])
    integral = design_rst_exact(INTEGRAL)
    found = integral_rst_closed_form().at({**VALUES, "alpha1": 1222.1, "alpha2": 308580.25})
    expected = [integral.R[1], *integral.S.coeffs()[::-1], *integral.T.coeffs()[::-1]]
    assert list(found) == expected


def test_latex_in_the_letters_of_the_field():
    text = rst_closed_form()._repr_latex_()
    assert r"r_{1} &= 2 \omega \xi+a_o-K_2" in text
    assert r"s_{1} &= \frac{\omega^{2} a_o}{K_s}" in text
    assert r"s_{2} &= \frac{\omega^{2} \alpha_2}{K_s}" in integral_rst_closed_form()._repr_latex_()


def test_sensitivities_are_the_slopes_of_the_closed_form():
    """Against central differences in fractions, whose error is the step squared."""
    table = rst_sensitivities(SIMPLE)
    letters = [Fraction(repr(value)) for value in (37.1, 812.5, 431.0, 0.83, 617.3)]
    step = Fraction(1, 10**9)
    value = np.array([float(v) for v in oracle.force_rst(*letters)])
    for column in range(5):
        up, down = list(letters), list(letters)
        up[column] += step
        down[column] -= step
        slope = [
            float((a - b) / (2 * step))
            for a, b in zip(oracle.force_rst(*up), oracle.force_rst(*down), strict=True)
        ]
        np.testing.assert_allclose(table.derivatives[:, column], slope, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(
            table.relative[:, column],
            table.derivatives[:, column] * float(letters[column]) / value,
            rtol=1e-14,
        )
    assert table.coefficients == ("r1", "s0", "s1", "t0", "t1")
    assert table.letters == ("K2", "Ks", "omega", "xi", "ao")


def test_gains_scale_with_one_over_stiffness():
    for table in (rst_sensitivities(SIMPLE), integral_rst_sensitivities(INTEGRAL)):
        column = table.relative[:, table.letters.index("Ks")]
        # r1 does not depend on Ks, every other coefficient is divided by it.
        np.testing.assert_array_equal(column, [0.0] + [-1.0] * (len(column) - 1))
        assert "| s0 |" in table._repr_markdown_()


def test_relative_sensitivity_of_a_vanishing_coefficient_is_not_a_number():
    at_zero = RSTSpecification(
        plant=ForcePlant(stiffness=1.0, velocity_gain=3.0),
        reference_model=ReferenceModel(bandwidth=1.0, damping=1.0),
        observer=first_order_observer(1.0),
    )
    table = rst_sensitivities(at_zero)
    assert np.isnan(table.relative[0]).all()
    np.testing.assert_array_equal(table.derivatives[0], [-1.0, 0.0, 2.0, 2.0, 1.0])


def test_unknown_coefficient_is_refused():
    with pytest.raises(ParameterError, match="r1, s0, s1, t0, t1"):
        rst_closed_form()["s9"]
