"""Witnesses of positive realness: rational data whose products anyone can multiply out again.

A strictly positive real G has a storage function V = xᵀPx with dV/dt < 2uy (Kalman, Yakubovich,
Popov). It is built here without a solver. With u = D(d/dt)ℓ and y = N(d/dt)ℓ, the form

    N(ζ)D(η) + D(ζ)N(η) = (ζ + η) P(ζ, η) + F(ζ)F(η) + Σ e_k ζᵏηᵏ

holds for x = (ℓ, ℓ', …) as soon as both sides agree on ζ = −η (Willems and Trentelman 1998).
There the left side is 2 Re N(jω)D(−jω), so F is a spectral factor of it less a small slack;
F is rounded, the rounding error goes into the e_k, and P follows by division. Everything stays
rational, and the dissipation is positive because e_k > 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import Any

from flint import acb, acb_poly, arb, ctx, fmpq, fmpq_mat, fmpq_poly

from mrac_design.polynomials.sign import (
    Sign,
    count_real_roots,
    sign_on_interval,
    square_free_factors,
)
from mrac_design.stability.boundary import Boundary, real_part_polynomial
from mrac_design.stability.exact_matrix import block_matrix, identity, is_positive_definite
from mrac_design.time_domain import Continuous


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StorageFunction:
    """A state-space form of G and P > 0 with V = xᵀPx storing less than is supplied."""

    A: fmpq_mat
    """State matrix, (n, n)."""
    B: fmpq_mat
    """Input matrix, (n, 1)."""
    C: fmpq_mat
    """Output matrix, (1, n)."""
    D: fmpq
    """Direct gain."""
    slope: fmpq
    """k of a term k·s in G (relative degree −1), which is lossless; 0 otherwise."""
    P: fmpq_mat
    """Storage matrix, (n, n)."""
    continuous: bool
    """Whether the state is differentiated (True) or advanced by one sample."""

    def verify(self) -> bool:
        """Multiply everything out in exact arithmetic and decide the matrix inequalities."""
        if self.slope < 0 or (self.A.nrows() and not is_positive_definite(self.P)):
            return False
        if not self.A.nrows():
            return bool(self.D > 0)
        if not self.continuous:
            return self._verify_discrete()
        dissipation = -(self.A.transpose() * self.P + self.P * self.A)
        mismatch = self.C.transpose() - self.P * self.B
        if self.D == 0:
            return not any(mismatch.entries()) and is_positive_definite(dissipation)
        corner = fmpq_mat([[2 * self.D]])
        return is_positive_definite(
            block_matrix([[dissipation, mismatch], [mismatch.transpose(), corner]])
        )

    def _verify_discrete(self) -> bool:
        A, B, P = self.A, self.B, self.P
        dissipation = P - A.transpose() * P * A
        mismatch = self.C.transpose() - A.transpose() * P * B
        corner = fmpq_mat([[2 * self.D]]) - B.transpose() * P * B
        return is_positive_definite(
            block_matrix([[dissipation, mismatch], [mismatch.transpose(), corner]])
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RealPartFactorisation:
    """M(w) = wᵏ g(w)² h(w) with h > 0 for w >= 0: shows that Re G is nowhere negative."""

    real_part: fmpq_poly
    """M(w) = |D(jω)|² Re G(jω) with w = ω²."""
    power: int
    """k."""
    root: fmpq_poly
    """g."""
    positive: fmpq_poly
    """h."""

    def verify(self) -> bool:
        """Multiply out, and count the zeros of h with a Sturm sequence."""
        product = fmpq_poly([0, 1]) ** self.power * self.root**2 * self.positive
        if product != self.real_part:
            return False
        if self.positive == 0:
            return True
        return bool(self.positive(0) > 0) and count_real_roots(self.positive, fmpq(0)) == 0


def real_part_factorisation(boundary: Boundary) -> RealPartFactorisation:
    """Split M(w) of a G whose real part is nowhere negative on the boundary."""
    M = boundary.real_part
    power = 0
    root, positive = fmpq_poly([1]), fmpq_poly([0] if M == 0 else [M.leading_coefficient()])
    for factor, multiplicity in square_free_factors(M):
        monic = factor / factor.leading_coefficient()
        if monic(0) == 0:
            monic = monic // fmpq_poly([0, 1])
            power = multiplicity
        root *= monic ** (multiplicity // 2)
        positive *= monic ** (multiplicity % 2)
    return RealPartFactorisation(real_part=M, power=power, root=root, positive=positive)


def storage_function(boundary: Boundary) -> StorageFunction:
    """Storage function of a G that is strictly positive real (established beforehand)."""
    N, D = boundary.numerator, boundary.denominator
    N, D = N / D.leading_coefficient(), D / D.leading_coefficient()
    slope = N.leading_coefficient() if boundary.relative_degree == -1 else fmpq(0)
    N -= slope * fmpq_poly([0, 1]) * D
    n = D.degree()
    direct = N[n]
    P = _storage_matrix(N, D)
    A = (
        fmpq_mat(
            [[fmpq(int(j == i + 1)) for j in range(n)] for i in range(n - 1)]
            + ([[-D[j] for j in range(n)]] if n else [])
        )
        if n
        else fmpq_mat(0, 0)
    )
    B = fmpq_mat(n, 1, [fmpq(int(i == n - 1)) for i in range(n)])
    C = fmpq_mat(1, n, [N[j] - direct * D[j] for j in range(n)])
    continuous = StorageFunction(A=A, B=B, C=C, D=direct, slope=slope, P=P, continuous=True)
    if isinstance(boundary.function.domain, Continuous) or n == 0:
        return continuous
    return _sampled(continuous)


def _sampled(image: StorageFunction) -> StorageFunction:
    """The storage function of G(z) from that of its image, s = (z − 1)/(z + 1)."""
    eye = identity(image.A.nrows())
    resolvent = (eye - image.A).inv()
    C = image.C * resolvent
    return StorageFunction(
        A=(eye + image.A) * resolvent,
        B=2 * resolvent * image.B,
        C=C,
        D=image.D + (C * image.B)[0, 0],
        slope=image.slope,
        P=image.P / 2,
        continuous=False,
    )


def _storage_matrix(N: fmpq_poly, D: fmpq_poly) -> fmpq_mat:
    """P of V = xᵀPx for x = (ℓ, ℓ', …) from N(ζ)D(η) + D(ζ)N(η) less the dissipation."""
    n = D.degree()
    supply = 2 * real_part_polynomial(N, D)
    factor, slack = _dissipation(supply)
    P = [[fmpq(0)] * (n + 1) for _ in range(n + 1)]
    for i in range(n):
        for j in range(1, n + 1):
            stored = N[i] * D[j] + D[i] * N[j] - factor[i] * factor[j]
            stored -= slack[i] if i == j else 0
            P[i][j - 1] = stored - (P[i - 1][j] if i else 0)
    return fmpq_mat([row[:n] for row in P[:n]]) if n else fmpq_mat(0, 0)


def _dissipation(supply: fmpq_poly) -> tuple[fmpq_poly, fmpq_poly]:
    """(F, e) with supply(ω²) = |F(jω)|² + Σ e_k ω²ᵏ and every e_k > 0."""
    if sign_on_interval(supply, fmpq(0)).sign is not Sign.POSITIVE:
        raise ValueError("a storage function needs Re G > 0 on the whole boundary")
    degree = supply.degree()
    shape = _slack_shape(supply)
    share = fmpq(1, 4)
    while sign_on_interval(supply - share * shape, fmpq(0)).sign is not Sign.POSITIVE:
        share /= 16
    target = supply - share * shape
    precision = 64
    while True:
        factor = _spectral_factor(target, precision)
        slack = supply - real_part_polynomial(factor, factor)
        if all(slack[k] > 0 for k in range(degree + 1)):
            return factor, slack
        precision *= 2


def _slack_shape(supply: fmpq_poly) -> fmpq_poly:
    """Polynomial with positive coefficients, as large as the supply at its two ends."""
    m = supply.degree()
    if m == 0:
        return supply
    ratio = supply[0] / supply[m]
    exponent = (ratio.p.bit_length() - ratio.q.bit_length()) // m
    corner = fmpq(2) ** exponent
    return fmpq_poly([supply[m] * comb(m, k) * corner ** (m - k) / 2**m for k in range(m + 1)])


def _spectral_factor(target: fmpq_poly, precision: int) -> fmpq_poly:
    """F with all roots in Re s < 0 and |F(jω)|² near target(ω²), rounded to `precision` bits."""
    in_s = [fmpq(0)] * (2 * target.degree() + 1)
    for k, c in enumerate(target.coeffs()):
        in_s[2 * k] = c if k % 2 == 0 else -c
    with ctx.workprec(precision):
        factor = acb_poly([acb(arb(target.leading_coefficient()).sqrt())])
        roots: Sequence[Any] = fmpq_poly(in_s).complex_roots() if len(in_s) > 1 else ()
        for root, multiplicity in roots:
            if root.real < 0:
                factor *= acb_poly([-root, 1]) ** multiplicity
        return fmpq_poly([c.real.mid().fmpq() for c in factor.coeffs()])
