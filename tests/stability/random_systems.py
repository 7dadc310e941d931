"""Random transfer functions close to the borders between the kinds of positive realness."""

from __future__ import annotations

import random
from collections.abc import Iterator

from flint import fmpq, fmpq_poly

S = fmpq_poly([0, 1])
ONE = fmpq_poly([1])

Pair = tuple[fmpq_poly, fmpq_poly]


def continuous_pairs(seed: int, count: int) -> Iterator[Pair]:
    """(numerator, denominator) in s: sums, all-pass transforms and plain random fractions."""
    generator = random.Random(seed)
    makers = (_random_fraction, _sum_of_positive_terms, _nearly_all_pass, _classic, _binary)
    for index in range(count):
        yield makers[index % len(makers)](generator)


def discrete_pairs(seed: int, count: int) -> Iterator[Pair]:
    """(numerator, denominator) in z: random fractions and near-all-pass transforms."""
    generator = random.Random(seed)
    for index in range(count):
        if index % 2:
            yield _disc_random(generator)
        else:
            yield _disc_all_pass(generator)


def _rational(generator: random.Random, low: float = 0.05, high: float = 20.0) -> fmpq:
    value = low * (high / low) ** generator.random()
    return fmpq(round(value * 1000), 1000)


def _margin(generator: random.Random) -> fmpq:
    size = fmpq(1, 10 ** generator.randint(1, 9))
    return generator.choice((-1, 0, 1)) * size


def _pole(generator: random.Random) -> fmpq_poly:
    """A real pole, a pair with damping down to 1e-4, or now and then a pair on the axis."""
    omega = _rational(generator)
    kind = generator.random()
    if kind < 0.4:
        return S + omega
    if kind < 0.85:
        damping = fmpq(1, 10 ** generator.randint(0, 4))
        return S * S + 2 * damping * omega * S + omega * omega
    return S * S + omega * omega if kind < 0.95 else S


def _random_fraction(generator: random.Random) -> Pair:
    denominator = ONE
    for _ in range(generator.randint(1, 3)):
        denominator *= _pole(generator)
    degree = max(0, denominator.degree() - generator.randint(0, 1))
    numerator = fmpq_poly([_rational(generator) for _ in range(degree)] + [1])
    return numerator, denominator


def _sum_of_positive_terms(generator: random.Random) -> Pair:
    """Σ k s/(s² + 2ζωs + ω²) + Σ k/(s + a) + d, with d on the edge of zero."""
    numerator, denominator = fmpq_poly([_margin(generator)]), ONE
    for _ in range(generator.randint(1, 3)):
        pole = _pole(generator)
        top = _rational(generator) * (S if pole.degree() == 2 else ONE)
        numerator, denominator = numerator * pole + top * denominator, denominator * pole
    return numerator, denominator


def _nearly_all_pass(generator: random.Random) -> Pair:
    """(1 − S)/(1 + S) with |S| = 1 + δ on the whole axis."""
    pole = ONE
    for _ in range(generator.randint(1, 3)):
        pole *= (
            _rational(generator) + S
            if generator.random() < 0.5
            else (S * S + _rational(generator, 0.001) * S + _rational(generator))
        )
    mirrored = fmpq_poly([c * (-1) ** k for k, c in enumerate(pole.coeffs())])
    gain = 1 + _margin(generator)
    return pole - gain * mirrored, pole + gain * mirrored


def _classic(generator: random.Random) -> Pair:
    """(s + a)/((s + b)(s + c)) at a = b + c + δ."""
    b, c = _rational(generator), _rational(generator)
    return S + b + c + _margin(generator), (S + b) * (S + c)


def _binary(generator: random.Random) -> Pair:
    """Coefficients that are binary floats, a light damping and an offset near the touching one."""
    damping, omega = 10 ** generator.uniform(-4, 0), 10 ** generator.uniform(-1, 1)
    # Re of ω²/(s² + 2ζωs + ω²) is lowest near −1/(4ζ(1 + ζ)).
    offset = (1 + 10 ** -generator.uniform(1, 9)) / (4 * damping * (1 + damping))
    denominator = fmpq_poly([_exact(omega**2), _exact(2 * damping * omega), 1])
    return _exact(omega**2) * ONE + _exact(offset) * denominator, denominator


def _exact(value: float) -> fmpq:
    return fmpq(*value.as_integer_ratio())


def _disc_root(generator: random.Random) -> fmpq_poly:
    radius = fmpq(
        generator.choice((3, 9, 99, 999, 1000)), 1000 if generator.random() < 0.7 else 1024
    )
    if generator.random() < 0.4:
        return S + generator.choice((-1, 1)) * radius
    return S * S - 2 * radius * fmpq(generator.randint(-9, 9), 10) * S + radius * radius


def _disc_random(generator: random.Random) -> Pair:
    denominator = ONE
    for _ in range(generator.randint(1, 2)):
        denominator *= _disc_root(generator)
    degree = denominator.degree() - (generator.random() < 0.1)
    numerator = fmpq_poly([fmpq(generator.randint(-9, 9), 20) for _ in range(degree)] + [1])
    return numerator, denominator


def _disc_all_pass(generator: random.Random) -> Pair:
    pole = ONE
    for _ in range(generator.randint(1, 2)):
        pole *= _disc_root(generator)
    mirrored = fmpq_poly(pole.coeffs()[::-1])
    gain = 1 + _margin(generator)
    top, bottom = pole - gain * mirrored, pole + gain * mirrored
    return (top, bottom) if bottom != 0 else (pole, ONE)
