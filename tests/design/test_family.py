from __future__ import annotations

import numpy as np
import pytest
from flint import fmpq_poly

from mrac_design.design import (
    KeepZeros,
    PolePlacement,
    UnitStaticGain,
    family_member,
    family_member_exact,
    greatest_degree_of_Q,
    integrator,
    place_poles,
    place_poles_exact,
    smallest_Q,
)
from mrac_design.errors import DegreeConditionError
from mrac_design.plant import Process
from mrac_design.polynomials import exact_polynomial
from mrac_design.time_domain import Continuous


def placement(observer_degree, **changes):
    return PolePlacement(
        process=Process.of(A=[1, 3, 2], B=[2, 8], domain=Continuous()),
        Am=exact_polynomial([1, 6, 25]),
        Ao=exact_polynomial([1, 10]) ** observer_degree,
        zeros=KeepZeros(),
        tracking=UnitStaticGain(),
        **changes,
    )


@pytest.mark.parametrize("changes", [{}, {"fixed_R": integrator(Continuous())}])
def test_every_member_places_the_same_poles(changes):
    least = 1 + len(changes)
    specification = placement(least + 3, **changes)
    base = place_poles_exact(specification)
    assert greatest_degree_of_Q(specification) == 2
    for Q in (fmpq_poly([5]), fmpq_poly([-1, 2]), fmpq_poly([1, 0, 7])):
        member = family_member_exact(base, Q)
        assert member.remainder.is_zero()
        assert member.S.degree() <= member.R.degree()
        assert member.R.leading_coefficient() == 1
        assert (member.S - base.S).degree() == Q.degree() + base.S.degree() + 1
        floating = family_member(place_poles(specification), Q)
        assert floating.residual < 1e-13
        np.testing.assert_allclose(
            floating.S, [float(c) for c in member.S.coeffs()[::-1]], rtol=1e-12
        )


def test_least_observer_leaves_no_freedom():
    base = place_poles_exact(placement(1))
    assert greatest_degree_of_Q(base.specification) == -1
    assert family_member_exact(base, fmpq_poly([0])) == base
    with pytest.raises(DegreeConditionError, match="deg Q = 1: needs at least degree 3, got 1"):
        family_member_exact(base, fmpq_poly([0, 1]))
    # The stated degree is enough, and one less is not.
    assert greatest_degree_of_Q(placement(3)) == 1
    assert greatest_degree_of_Q(placement(2)) == 0


@pytest.mark.parametrize("degree_of_S", [1, 2, 3])
def test_smallest_member_beats_its_neighbours(degree_of_S):
    base = place_poles_exact(placement(3))
    best = smallest_Q(base, degree_of_S=degree_of_S)
    member = family_member_exact(base, best)
    assert member.S.degree() <= degree_of_S
    assert member.remainder.is_zero()

    # Roots of A and B are 1, 2, 4: the unit of time is 2 rad/s; see `smallest_Q` for the cost.
    def cost(design):
        def squares(polynomial):
            return sum(float(c * 2**k) ** 2 for k, c in enumerate(polynomial.coeffs()))

        process = base.specification.process
        return squares(process.A) * squares(design.R) + squares(process.B) * squares(design.S)

    assert cost(member) <= cost(base)
    for power in range(degree_of_S - 1):
        for step in (-1, 1):
            nudge = exact_polynomial([step * 1e-3] + [0] * power)
            assert cost(family_member_exact(base, best + nudge)) > cost(member)


def test_chosen_degree_must_be_possible():
    base = place_poles(placement(2))
    with pytest.raises(DegreeConditionError, match="degree of S: needs at least degree 1, got 0"):
        smallest_Q(base, degree_of_S=0)
    with pytest.raises(DegreeConditionError, match=r"Ao .* needs at least degree 3, got 2"):
        smallest_Q(base, degree_of_S=3)
