"""All controllers with the same closed-loop polynomial: R + Q B Rf Sf, S − Q A Rf Sf.

Q is any polynomial that leaves the controller causal; the room for it comes from an observer
polynomial of more than the least degree.
"""

from __future__ import annotations

from dataclasses import replace

from flint import fmpq, fmpq_mat, fmpq_poly

from mrac_design.design.pole_placement import PolePlacement
from mrac_design.design.polynomial_design import (
    ExactPolynomialDesign,
    PolynomialDesign,
    rounded_design,
)
from mrac_design.errors import DegreeConditionError
from mrac_design.polynomials.diophantine import RESIDUAL_LIMIT
from mrac_design.polynomials.rationals import binary_polynomial, binary_rational
from mrac_design.polynomials.sylvester import natural_frequency


def greatest_degree_of_Q(specification: PolePlacement) -> int:
    """Largest degree of Q that leaves the controller causal; −1 when only Q = 0 does."""
    return max(_degree_of_S_limit(specification) - _directions(specification)[1].degree(), -1)


def family_member_exact(design: ExactPolynomialDesign, Q: fmpq_poly) -> ExactPolynomialDesign:
    """The exact controller Q away from `design`.

    Raises DegreeConditionError with the deg Ao that a Q of this degree needs.
    """
    _require_room(design.specification, Q)
    of_R, of_S = _directions(design.specification)
    return replace(design, R=design.R + Q * of_R, S=design.S - Q * of_S)


def family_member(
    design: PolynomialDesign, Q: fmpq_poly, *, residual_limit: float = RESIDUAL_LIMIT
) -> PolynomialDesign:
    """The floating controller Q away from `design`.

    Raises DegreeConditionError as `family_member_exact`, IllConditionedError when the rounded
    controller misses the closed-loop polynomial by more than `residual_limit`.
    """
    _require_room(design.specification, Q)
    of_R, of_S = _directions(design.specification)
    return rounded_design(
        design,
        R=binary_polynomial(design.R) + Q * of_R,
        S=binary_polynomial(design.S) - Q * of_S,
        residual_limit=residual_limit,
    )


def smallest_Q(design: ExactPolynomialDesign | PolynomialDesign, *, degree_of_S: int) -> fmpq_poly:
    """The Q with which S gets at most the chosen degree and the coefficients stay smallest.

    It minimises |A|²|R|² + |B|²|S|² (sums of squared coefficients, time scaled by the roots of
    A and B), which bounds how much A R and B S cancel in A R + B S.

    Raises DegreeConditionError when deg S is too small for any solution or too large for a
    causal one.
    """
    specification = design.specification
    of_R, of_S = _directions(specification)
    if degree_of_S < of_S.degree() - 1:
        raise DegreeConditionError(
            "chosen degree of S", required=of_S.degree() - 1, given=degree_of_S
        )
    count = degree_of_S - of_S.degree() + 1
    if count == 0:
        return fmpq_poly([0])
    _require_room(specification, fmpq_poly([0] * (count - 1) + [1]))
    A, B = specification.process.A, specification.process.B
    unit = binary_rational(natural_frequency(A, B))
    weight_R, weight_S = (_squares(_in_unit(part, unit)) for part in (A, B))
    R, S = design.loop.R, design.loop.S
    shifts = [fmpq_poly([0] * power + [1]) for power in range(count)]
    columns_R = [_in_unit(shift * of_R, unit) for shift in shifts]
    columns_S = [_in_unit(shift * of_S, unit) for shift in shifts]
    target_R, target_S = _in_unit(R, unit), _in_unit(S, unit)
    normal = [
        [
            weight_R * _dot(a, c) + weight_S * _dot(b, d)
            for c, d in zip(columns_R, columns_S, strict=True)
        ]
        for a, b in zip(columns_R, columns_S, strict=True)
    ]
    right = [
        [weight_S * _dot(b, target_S) - weight_R * _dot(a, target_R)]
        for a, b in zip(columns_R, columns_S, strict=True)
    ]
    solution = fmpq_mat(normal).solve(fmpq_mat(right))
    return fmpq_poly([solution[power, 0] for power in range(count)])


def _directions(specification: PolePlacement) -> tuple[fmpq_poly, fmpq_poly]:
    """What multiplies Q in R and in −S."""
    fixed = specification.fixed_R * specification.fixed_S
    return specification.process.B * fixed, specification.process.A * fixed


def _degree_of_S_limit(specification: PolePlacement) -> int:
    closed_loop = specification.closed_loop.degree()
    degree_of_R = closed_loop - specification.process.A.degree()
    return int(degree_of_R - specification.pole_excess)


def _require_room(specification: PolePlacement, Q: fmpq_poly) -> None:
    missing = Q.degree() - greatest_degree_of_Q(specification)
    if not Q.is_zero() and missing > 0:
        given = specification.Ao.degree()
        # Below the degree that leaves room for a constant Q the shortfall is larger.
        first = _directions(specification)[1].degree() - _degree_of_S_limit(specification)
        raise DegreeConditionError(
            f"degree of the observer polynomial Ao for deg Q = {Q.degree()}",
            required=given + first + Q.degree(),
            given=given,
        )


def _in_unit(polynomial: fmpq_poly, unit: fmpq) -> fmpq_poly:
    return polynomial(fmpq_poly([fmpq(0), unit]))


def _dot(left: fmpq_poly, right: fmpq_poly) -> fmpq:
    pairs = zip(left.coeffs(), right.coeffs(), strict=False)
    return sum((a * b for a, b in pairs), fmpq(0))


def _squares(polynomial: fmpq_poly) -> fmpq:
    return _dot(polynomial, polynomial)
