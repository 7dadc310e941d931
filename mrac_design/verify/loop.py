"""The adaptive force axis rebuilt from the certificate's numbers.

Written from the loop's equations, apart from the code that made the certificate. State
x = (ŷ, Ẑ, x̂u, x̂y) and, when sampled, the commands still under way, newest first:

    ŷ' = Ẑ      Ẑ' = v − K Ẑ − d      x̂u' = −c x̂u + û      x̂y' = −c x̂y + κ ŷ      force = κ ŷ
    û = −r x̂u − s0 (κ ŷ − c x̂y) − s1 x̂y          v = û, or û of some samples ago

with K = K2/ω and c = ao/ω. Sampled, plant and filters hold their inputs for one period.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

from flint import fmpq, fmpq_mat

from mrac_design.verify.document import DocumentError, Reader

SERIES_TERMS = 60
"""Terms of the alternating series for exp(−x), x <= 1/2: the last is below 10⁻⁹⁹."""


@dataclass(frozen=True)
class Corner:
    """The loop at one corner of the polytope."""

    name: str
    A: fmpq_mat
    force: list[fmpq_mat]
    command: fmpq_mat
    hold: tuple[fmpq, fmpq]

    def held(self, column: tuple[int, int]) -> fmpq_mat:
        """Disturbance column for signs (of ŷ, of Ẑ): the held response, or a unit acceleration."""
        p, q = self.hold
        rest = [fmpq(0)] * (self.A.nrows() - 2)
        return fmpq_mat(self.A.nrows(), 1, [column[0] * q, column[1] * p, *rest])


@dataclass(frozen=True)
class Loop:
    """What all corners share."""

    sampled: bool
    delay: int
    K: fmpq
    c: fmpq
    period: fmpq
    energy_input: fmpq_mat
    exponentials: tuple[tuple[fmpq, ...], tuple[fmpq, ...]]

    @property
    def size(self) -> int:
        """Number of states."""
        return 4 + self.delay

    @property
    def step(self) -> str:
        """What the decay is counted per."""
        return "sample" if self.sampled else "unit of ωt"

    @property
    def disturbances(self) -> list[tuple[int, int]]:
        """Signs of the corners of what a bounded disturbance does."""
        return [(1, 1), (-1, 1)] if self.sampled else [(0, 1)]


def read_loop(reader: Reader) -> Loop:
    """The loop's numbers, with the enclosures of a sampled one checked."""
    omega = _positive(reader, "/loop/bandwidth")
    _positive(reader, "/loop/design_stiffness")
    pole = _positive(reader, "/loop/observer_pole")
    gain = reader.rational("/loop/velocity_gain")
    if gain < 0:
        raise DocumentError("/loop/velocity_gain", "must not be negative")
    for name in ("r1_minus_ao", "s0", "s1"):
        reader.rational(f"/loop/{name}")
    kind = reader.value("/timing/kind")
    if kind == "continuous":
        column = fmpq_mat(4, 1, [0, 1, 0, 0])
        return Loop(False, 0, gain / omega, pole / omega, fmpq(0), column, ((), ()))
    if kind != "sampled":
        raise DocumentError("/timing/kind", "must be 'continuous' or 'sampled'")
    period = _positive(reader, "/timing/period")
    delay = reader.rational("/timing/delay")
    if delay not in (0, 1, 2, 3, 4):
        raise DocumentError("/timing/delay", "must be a whole number from 0 to 4")
    a = _enclosure(reader, "/timing/velocity_exponential", gain * period)
    b = _enclosure(reader, "/timing/observer_exponential", pole * period)
    energy = _energy_input(reader, gain / omega, period * omega, a, int(delay.p))
    return Loop(True, int(delay.p), gain / omega, pole / omega, period * omega, energy, (a, b))


def corners(reader: Reader, loop: Loop) -> list[Corner]:
    """The loop at every corner of gains, stiffness ratio and enclosures."""
    lower, upper = reader.rationals("/box/lower", 3), reader.rationals("/box/upper", 3)
    ratio = reader.rationals("/box/stiffness_ratio", 2)
    if any(a > b for a, b in zip(lower, upper, strict=True)):
        raise DocumentError("/box/lower", "exceeds /box/upper")
    if not 0 < ratio[0] <= ratio[1]:
        raise DocumentError("/box/stiffness_ratio", "needs 0 < lowest <= highest")
    nominal = _nominal(reader)
    for name, low, value, high in zip(("r1", "s0", "s1"), lower, nominal, upper, strict=True):
        if not low <= value <= high:
            raise DocumentError("/box/lower", f"the nominal gain {name} is outside the box")
    ends = [sorted(set(pair)) for pair in (*zip(lower, upper, strict=True), ratio)]
    if not loop.sampled:
        return [_continuous(loop, values) for values in product(*ends)]
    bounds = [sorted(set(pair)) for pair in loop.exponentials]
    return [_held(loop, values[:4], values[4], values[5]) for values in product(*ends, *bounds)]


def _nominal(reader: Reader) -> list[fmpq]:
    omega = reader.rational("/loop/bandwidth")
    b0 = reader.rational("/loop/design_stiffness")
    r, s0, s1 = (reader.rational(f"/loop/{name}") for name in ("r1_minus_ao", "s0", "s1"))
    return [r / omega, s0 * b0 / omega**2, s1 * b0 / omega**3]


def _command(loop: Loop, values: tuple[fmpq, ...]) -> list[fmpq]:
    r, s0, s1, ratio = values
    return [-s0 * ratio, fmpq(0), -r, s0 * loop.c - s1, *([fmpq(0)] * loop.delay)]


def _continuous(loop: Loop, values: tuple[fmpq, ...]) -> Corner:
    u, ratio = _command(loop, values), values[3]
    accelerated = [u[0], u[1] - loop.K, u[2], u[3]]
    A = fmpq_mat(
        [[0, 1, 0, 0], accelerated, [u[0], u[1], u[2] - loop.c, u[3]], [ratio, 0, 0, -loop.c]]
    )
    force = fmpq_mat([[ratio, 0, 0, 0]])
    return Corner(_name(values), A, [force], fmpq_mat([accelerated]), (fmpq(1), fmpq(0)))


def _held(loop: Loop, values: tuple[fmpq, ...], a: fmpq, b: fmpq) -> Corner:
    n, ratio = loop.size, values[3]
    unit = [[fmpq(int(i == j)) for j in range(n)] for i in range(n)]
    u = _command(loop, values)
    v = unit[n - 1] if loop.delay else u
    p = (1 - a) / loop.K if loop.K else loop.period
    q = (loop.period - p) / loop.K if loop.K else loop.period**2 / 2
    f = (1 - b) / loop.c

    def mix(*terms: tuple[fmpq, list[fmpq]]) -> list[fmpq]:
        return [sum((weight * row[j] for weight, row in terms), fmpq(0)) for j in range(n)]

    one = fmpq(1)
    rows = [
        mix((one, unit[0]), (p, unit[1]), (q, v)),
        mix((a, unit[1]), (p, v)),
        mix((b, unit[2]), (f, u)),
        mix((b, unit[3]), (f * ratio, unit[0])),
    ]
    if loop.delay:
        rows += [u, *unit[4 : n - 1]]
    within = [
        mix((ratio, unit[0])),
        mix((ratio, unit[0]), (ratio * p, unit[1])),
        mix((ratio, unit[0]), (ratio * p, unit[1]), (ratio * q, v)),
    ]
    command = fmpq_mat([mix((one, v), (-loop.K, unit[1]))])
    force = [fmpq_mat([row]) for row in within]
    return Corner(_name(values), fmpq_mat(rows), force, command, (p, q))


def _enclosure(reader: Reader, pointer: str, x: fmpq) -> tuple[fmpq, ...]:
    """The stated bounds of exp(−x), proved by an alternating series and repeated squaring."""
    low, high = reader.rationals(pointer, 2)
    halvings = 0
    while x > fmpq(1, 2):
        x, halvings = x / 2, halvings + 1
    term, total, sums = fmpq(1), fmpq(1), []
    for k in range(1, SERIES_TERMS + 1):
        term = -term * x / k
        total += term
        sums.append(total)
    below, above = min(sums[-2:]), max(sums[-2:])
    for _ in range(halvings):
        below, above = below**2, above**2
    if not low <= below <= above <= high:
        raise DocumentError(pointer, "does not enclose the exponential")
    if high - low > fmpq(1, 10**9):
        raise DocumentError(pointer, "is wider than 1e-9")
    return tuple(sorted({low, high}))


def _energy_input(reader: Reader, K: fmpq, h: fmpq, a: tuple[fmpq, ...], delay: int) -> fmpq_mat:
    """L with L Lᵀ >= ∫ g gᵀ for the plant's response g = (p(τ), exp(−Kτ)) within a period.

    The integral is affine in a = exp(−Kh) and in a², so the ends of both decide.
    """
    pointer = "/timing/energy_input"
    L = fmpq_mat(reader.matrix(pointer, 2, 2))
    for first, second in product(a, [value**2 for value in a]):
        if K:
            square = (1 - second) / (2 * K)
            mixed = (1 - 2 * first + second) / (2 * K**2)
            double = (h - 2 * (1 - first) / K + square) / K**2
        else:
            double, mixed, square = h**3 / 3, h**2 / 2, h
        excess = L * L.transpose() - fmpq_mat([[double, mixed], [mixed, square]])
        if excess[0, 0] < 0 or excess.det() < 0:
            raise DocumentError(pointer, "does not cover the disturbance of one period")
    rows = L.tolist() + [[fmpq(0), fmpq(0)]] * (2 + delay)
    return fmpq_mat(rows)


def _positive(reader: Reader, pointer: str) -> fmpq:
    value = reader.rational(pointer)
    if value <= 0:
        raise DocumentError(pointer, "must be positive")
    return value


def _name(values: tuple[fmpq, ...]) -> str:
    digits = ", ".join(f"{int(v.p) / int(v.q):.4g}" for v in values)
    return f"the corner (r1, s0, s1, Ks/b0) = ({digits}), scaled"
