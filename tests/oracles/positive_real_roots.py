"""Positive realness from enclosed roots, without Sturm sequences, Routh's array or bilinear maps.

Every root is an `arb` ball of python-flint, refined until the question asked of it is decided; an
equality is decided by exact division. The real part on the boundary is read off the numerator of
G(s) + G(−s), in discrete time of G(z) + G(1/z), at points between that numerator's own roots.
Answers are a dict of the three kinds of positive realness.
"""

from __future__ import annotations

import itertools

from flint import acb, arb, ctx, fmpq, fmpq_poly

PR, SPR, STRONG = "positive real", "strictly positive real", "strongly strictly positive real"


def continuous_verdicts(numerator: fmpq_poly, denominator: fmpq_poly) -> dict[str, bool]:
    """PR, SPR and strong SPR of numerator/denominator in s."""
    common = numerator.gcd(denominator)
    N, D = numerator // common, denominator // common
    if N == 0:
        unstable = any(place > 0 for place, _, _ in _half_plane_places(D))
        return {PR: not unstable, SPR: False, STRONG: False}
    places = _half_plane_places(D)
    open_stable = all(place < 0 for place, _, _ in places)
    degree = D.degree() - N.degree()
    lead = N.leading_coefficient() / D.leading_coefficient()
    order_ok = abs(degree) <= 1 and (degree != -1 or lead > 0)
    E = N * _reflected(D) + _reflected(N) * D  # G(s) + G(−s) over D(s) D(−s)
    lowest = _sign_on_axis(E)
    residues_ok = all(
        multiplicity == 1 and _residue_positive(N, D, root)
        for place, multiplicity, root in places
        if place == 0
    )
    result = {PR: order_ok and residues_ok and lowest >= 0}
    result[PR] = result[PR] and all(place <= 0 for place, _, _ in places)
    n = D.degree()
    top = E[2 * n] * (-1) ** n  # times ω^(2n) on the axis
    below = E[2 * n - 2] * (-1) ** (n - 1) if n else fmpq(0)
    strict = open_stable and order_ok and lowest > 0
    result[SPR] = strict and bool(top > 0 or (degree == 1 and below > 0))
    result[STRONG] = strict and bool(top > 0)
    return result


def discrete_verdicts(numerator: fmpq_poly, denominator: fmpq_poly) -> dict[str, bool]:
    """PR and SPR of numerator/denominator in z, |z| > 1 being the region of analyticity."""
    common = numerator.gcd(denominator)
    N, D = numerator // common, denominator // common
    proper = N.degree() <= D.degree()
    places = _disc_places(D)
    n = max(N.degree(), D.degree())
    E = N * _reversed(D, n) + _reversed(N, n) * D  # z^n (G(z) + G(1/z)) D(z) D(1/z)
    lowest = _sign_on_circle(E, n)
    residues_ok = all(
        multiplicity == 1 and _circle_residue_positive(N, D, root)
        for place, multiplicity, root in places
        if place == 0
    )
    inside = all(place < 0 for place, _, _ in places)
    not_outside = all(place <= 0 for place, _, _ in places)
    positive = proper and not_outside and residues_ok and lowest >= 0
    strict = proper and inside and lowest > 0
    return {PR: positive, SPR: strict, STRONG: strict}


def _half_plane_places(D: fmpq_poly) -> list[tuple[int, int, acb]]:
    """(sign of the real part, multiplicity, root) of every distinct root of D."""
    if D.degree() < 1:
        return []
    # A root shared by D(s) and D(−s) lies on the axis or has a mirror image in the other half.
    mirrored = D.gcd(_reflected(D))
    return [_place(root, m, mirrored) for root, m in _roots(D)]


def _place(root: acb, multiplicity: int, mirrored: fmpq_poly) -> tuple[int, int, acb]:
    if root.real > 0:
        return 1, multiplicity, root
    if root.real < 0:
        return -1, multiplicity, root
    assert mirrored.degree() > 0
    return 0, multiplicity, root


def _roots(p: fmpq_poly) -> list[tuple[acb, int]]:
    """Roots with balls narrow enough that a real part containing zero can only be zero."""
    with ctx.workprec(2000):
        return p.complex_roots()


def _sign_on_axis(E: fmpq_poly) -> int:
    """1, 0 or −1 as the even E(jω) is positive, touches zero or is negative somewhere."""
    if E == 0:
        return 0
    in_w = fmpq_poly([c * (-1) ** k for k, c in enumerate(E.coeffs()[0::2])])
    return _lowest_sign(in_w, arb(0), None)


def _sign_on_circle(E: fmpq_poly, n: int) -> int:
    """The same for the palindromic E on |z| = 1, as a polynomial in x = cos θ (Chebyshev)."""
    if E == 0:
        return 0
    previous, current = fmpq_poly([1]), fmpq_poly([0, 1])
    total = E[n] * previous
    for k in range(1, n + 1):
        total += 2 * E[n + k] * current
        previous, current = current, fmpq_poly([0, 2]) * current - previous
    return _lowest_sign(total, arb(-1), arb(1))


def _lowest_sign(p: fmpq_poly, low: arb, high: arb | None) -> int:
    """Sign of the least value of p over [low, high] from its enclosed real roots."""
    ends = [low.fmpq(), None if high is None else high.fmpq()]
    real = [root.real for root, _ in _roots(p) if root.imag == 0] if p.degree() > 0 else []
    inner = sorted(
        (r for r in real if r > low and (high is None or r < high)), key=lambda r: float(r.mid())
    )
    touched = len(inner) + sum(1 for end in ends if end is not None and p(end) == 0)
    marks = [low, *inner] + ([] if high is None else [high])
    points = [((a + b) / 2).mid().fmpq() for a, b in itertools.pairwise(marks)]
    if high is None:
        points.append((marks[-1] + 1).mid().fmpq())
    if any(p(point) < 0 for point in points):
        return -1
    return 0 if touched else 1


def _residue_positive(N: fmpq_poly, D: fmpq_poly, root: acb) -> bool:
    """Whether N/D' at a pole is real and positive; reality by squaring it away exactly."""
    with ctx.workprec(2000):
        value = _at(N, root) / _at(D.derivative(), root)
        return bool(value.imag.contains(0) and value.real > 0)


def _circle_residue_positive(N: fmpq_poly, D: fmpq_poly, root: acb) -> bool:
    """Whether N/(z D') at a pole on the circle is real and positive."""
    with ctx.workprec(2000):
        value = _at(N, root) / (root * _at(D.derivative(), root))
        return bool(value.imag.contains(0) and value.real > 0)


def _disc_places(D: fmpq_poly) -> list[tuple[int, int, acb]]:
    """(sign of |z| − 1, multiplicity, root) of every distinct root of D."""
    if D.degree() < 1:
        return []
    places = []
    with ctx.workprec(2000):
        for root, multiplicity in D.complex_roots():
            size = root.real**2 + root.imag**2
            places.append((1 if size > 1 else -1 if size < 1 else 0, multiplicity, root))
    return places


def _at(p: fmpq_poly, z: acb) -> acb:
    total = acb(0)
    for c in reversed(p.coeffs()):
        total = total * z + acb(c)
    return total


def _reflected(p: fmpq_poly) -> fmpq_poly:
    """p(−s)."""
    return fmpq_poly([c * (-1) ** k for k, c in enumerate(p.coeffs())])


def _reversed(p: fmpq_poly, n: int) -> fmpq_poly:
    """z^n p(1/z)."""
    return fmpq_poly([p[n - k] for k in range(n + 1)])
