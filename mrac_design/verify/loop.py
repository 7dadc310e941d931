"""The adaptive force axis rebuilt from the certificate's numbers.

Written from the loop's equations, apart from the code that made the certificate. The observer
polynomial is Ao = pⁿ + a1 pⁿ⁻¹ + … + an, the given factor of R is D = pⁿ⁻¹ + d1 pⁿ⁻² + …, and the
controller R u = −S y with R = (p + c + r) D, c = a1 − d1, S = s0 pⁿ + … + sn is written as

    Ao-filtered:   (Ao + K + r D) u/Ao = −S y/Ao,   K = (p + c) D − Ao

State x = (ŷ, Ẑ, x̂u, x̂y) with x̂u, x̂y the n filtered powers of û and κ ŷ, highest first, and, when
sampled, the commands still under way, newest first. In time ωt, force = κ ŷ and

    ŷ' = Ẑ      Ẑ' = v − (K2/ω) Ẑ − d      v = û, or û of some samples ago

Sampled, the plant holds its input for one period, and the filters advance by the stated step.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

from flint import arb_mat, fmpq, fmpq_mat

from mrac_design.verify.document import DocumentError, Reader

SERIES_TERMS = 60
"""Terms of the alternating series for exp(−x), x <= 1/2: the last is below 10⁻⁹⁹."""
LARGEST_DEGREE = 8
"""Observers of a higher degree are refused; their corners would be too many to decide."""
STEP_TOLERANCE = fmpq(1, 10**9)
"""How far the stated step of the filters may be from the exact one, relative to its largest
entry in scaled time: it is the definition of the filters, but must be recognisable as theirs."""


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
class Controller:
    """The controller in time ωt and force b0 u/ω²."""

    observer: list[fmpq]
    """a1 … an."""
    factor: list[fmpq]
    """1, d1 … of D, n entries."""
    known: list[fmpq]
    """K from the power n − 1 down, n entries, the first zero."""
    units: list[fmpq]
    """What the scaled gains of the box are multiplied by."""

    @property
    def degree(self) -> int:
        """n."""
        return len(self.observer)

    def command(self, values: tuple[fmpq, ...]) -> list[fmpq]:
        """û as a row on (ŷ, Ẑ, x̂u, x̂y) for gains and stiffness ratio of a corner."""
        ratio = values[-1]
        r, *s = [value * unit for value, unit in zip(values[:-1], self.units, strict=True)]
        row = [-s[0] * ratio, fmpq(0)]
        row += [-(k + r * d) for k, d in zip(self.known, self.factor, strict=True)]
        row += [s[0] * a - later for a, later in zip(self.observer, s[1:], strict=True)]
        return row


@dataclass(frozen=True)
class Loop:
    """What all corners share."""

    sampled: bool
    delay: int
    K: fmpq
    controller: Controller
    period: fmpq
    energy_input: fmpq_mat
    exponential: tuple[fmpq, ...]
    step: tuple[fmpq_mat, list[fmpq]]
    """Filters: companion matrix and input, or transition and held input."""

    @property
    def size(self) -> int:
        """Number of states."""
        return 2 + 2 * self.controller.degree + self.delay

    @property
    def unit(self) -> str:
        """What the decay is counted per."""
        return "sample" if self.sampled else "unit of ωt"

    @property
    def disturbances(self) -> list[tuple[int, int]]:
        """Signs of the corners of what a bounded disturbance does."""
        return [(1, 1), (-1, 1)] if self.sampled else [(0, 1)]


def read_loop(reader: Reader) -> Loop:
    """The loop's numbers, with the enclosure and the filter step of a sampled one checked."""
    omega = _positive(reader, "/loop/bandwidth")
    gain = reader.rational("/loop/velocity_gain")
    if gain < 0:
        raise DocumentError("/loop/velocity_gain", "must not be negative")
    controller = _controller(reader, omega)
    n, K = controller.degree, gain / omega
    companion = fmpq_mat(
        [[-a for a in controller.observer]]
        + [[fmpq(int(j == i)) for j in range(n)] for i in range(n - 1)]
    )
    flow = companion, [fmpq(1)] + [fmpq(0)] * (n - 1)
    kind = reader.value("/timing/kind")
    if kind == "continuous":
        column = fmpq_mat(2 + 2 * n, 1, [0, 1] + [0] * (2 * n))
        return Loop(False, 0, K, controller, fmpq(0), column, (), flow)
    if kind != "sampled":
        raise DocumentError("/timing/kind", "must be 'continuous' or 'sampled'")
    period = _positive(reader, "/timing/period")
    delay = reader.rational("/timing/delay")
    if delay not in (0, 1, 2, 3, 4):
        raise DocumentError("/timing/delay", "must be a whole number from 0 to 4")
    a = _enclosure(reader, "/timing/velocity_exponential", gain * period)
    step = _filter_step(reader, omega, n)
    _check_step(step, flow, period * omega)
    energy = _energy_input(reader, K, period * omega, a, 2 * n + int(delay.p))
    return Loop(True, int(delay.p), K, controller, period * omega, energy, a, step)


def corners(reader: Reader, loop: Loop) -> list[Corner]:
    """The loop at every corner of gains, stiffness ratio and enclosure."""
    count = loop.controller.degree + 2
    lower, upper = reader.rationals("/box/lower", count), reader.rationals("/box/upper", count)
    ratio = reader.rationals("/box/stiffness_ratio", 2)
    if any(a > b for a, b in zip(lower, upper, strict=True)):
        raise DocumentError("/box/lower", "exceeds /box/upper")
    if not 0 < ratio[0] <= ratio[1]:
        raise DocumentError("/box/stiffness_ratio", "needs 0 < lowest <= highest")
    gains = reader.rationals("/loop/gains", count)
    scale = reader.rationals("/loop/gain_scale", count)
    for k in range(count):
        if not lower[k] <= gains[k] / scale[k] <= upper[k]:
            raise DocumentError(f"/box/lower/{k}", "the nominal gain is outside the box")
    ends = [sorted(set(pair)) for pair in (*zip(lower, upper, strict=True), ratio)]
    if not loop.sampled:
        return [_continuous(loop, values) for values in product(*ends)]
    held = product(product(*ends), sorted(set(loop.exponential)))
    return [_held(loop, values, a) for values, a in held]


def _controller(reader: Reader, omega: fmpq) -> Controller:
    b0 = _positive(reader, "/loop/design_stiffness")
    stated = reader.value("/loop/observer")
    n = len(stated) - 1 if isinstance(stated, list) else 0
    if not 1 <= n <= LARGEST_DEGREE:
        raise DocumentError("/loop/observer", f"needs a degree from 1 to {LARGEST_DEGREE}")
    Ao = reader.rationals("/loop/observer", n + 1)
    D = reader.rationals("/loop/internal_model", n)
    for name, polynomial in (("observer", Ao), ("internal_model", D)):
        if polynomial[0] != 1:
            raise DocumentError(f"/loop/{name}/0", "must be 1")
    reader.rationals("/loop/gains", n + 2)
    units = []
    for k, scale in enumerate(reader.rationals("/loop/gain_scale", n + 2)):
        if scale <= 0:
            raise DocumentError(f"/loop/gain_scale/{k}", "must be positive")
        units.append(scale / omega if k == 0 else scale * b0 / omega ** (k + 1))
    observer = [a / omega**k for k, a in enumerate(Ao)]
    factor = [d / omega**k for k, d in enumerate(D)]
    c = observer[1] - (factor[1] if n > 1 else 0)
    shifted = [*factor, fmpq(0)]
    known = [shifted[k] + c * shifted[k - 1] - observer[k] for k in range(1, n + 1)]
    return Controller(observer[1:], factor, known, units)


def _continuous(loop: Loop, values: tuple[fmpq, ...]) -> Corner:
    u, ratio, n = loop.controller.command(values), values[-1], loop.controller.degree
    companion, drive = loop.step
    accelerated = [u[0], u[1] - loop.K, *u[2:]]
    rows = [[fmpq(int(j == 1)) for j in range(loop.size)], accelerated]
    rows += _filters(companion, drive, u, ratio, loop.size)
    force = fmpq_mat([[ratio] + [fmpq(0)] * (2 * n + 1)])
    return Corner(
        _name(values), fmpq_mat(rows), [force], fmpq_mat([accelerated]), (fmpq(1), fmpq(0))
    )


def _filters(F: fmpq_mat, G: list[fmpq], u: list[fmpq], ratio: fmpq, size: int) -> list[list[fmpq]]:
    """Rows of both filters: F x̂ + G times what drives them, û and κ ŷ."""
    n = len(G)
    force = [ratio] + [fmpq(0)] * (size - 1)
    rows = []
    for start, driving in ((2, u), (2 + n, force)):
        for i in range(n):
            row = [G[i] * value for value in driving]
            for j in range(n):
                row[start + j] += F[i, j]
            rows.append(row)
    return rows


def _held(loop: Loop, values: tuple[fmpq, ...], a: fmpq) -> Corner:
    size, ratio = loop.size, values[-1]
    unit = [[fmpq(int(i == j)) for j in range(size)] for i in range(size)]
    u = loop.controller.command(values) + [fmpq(0)] * loop.delay
    v = unit[size - 1] if loop.delay else u
    p = (1 - a) / loop.K if loop.K else loop.period
    q = (loop.period - p) / loop.K if loop.K else loop.period**2 / 2

    def mix(*terms: tuple[fmpq, list[fmpq]]) -> list[fmpq]:
        return [sum((weight * row[j] for weight, row in terms), fmpq(0)) for j in range(size)]

    one = fmpq(1)
    rows = [mix((one, unit[0]), (p, unit[1]), (q, v)), mix((a, unit[1]), (p, v))]
    rows += _filters(*loop.step, u, ratio, size)
    if loop.delay:
        rows += [u, *unit[size - loop.delay : size - 1]]
    within = [
        mix((ratio, unit[0])),
        mix((ratio, unit[0]), (ratio * p, unit[1])),
        mix((ratio, unit[0]), (ratio * p, unit[1]), (ratio * q, v)),
    ]
    command = fmpq_mat([mix((one, v), (-loop.K, unit[1]))])
    force = [fmpq_mat([row]) for row in within]
    return Corner(_name(values), fmpq_mat(rows), force, command, (p, q))


def _filter_step(reader: Reader, omega: fmpq, n: int) -> tuple[fmpq_mat, list[fmpq]]:
    """The stated step for filter states in time ωt: the k-th is ωᵏ times that in seconds."""
    F = reader.matrix("/timing/observer_transition", n, n)
    G = reader.rationals("/timing/observer_input", n)
    scaled = [
        [value * omega**i / omega**j for j, value in enumerate(row)] for i, row in enumerate(F)
    ]
    return fmpq_mat(scaled), [value * omega ** (i + 1) for i, value in enumerate(G)]


def _check_step(
    step: tuple[fmpq_mat, list[fmpq]], flow: tuple[fmpq_mat, list[fmpq]], period: fmpq
) -> None:
    """The stated step is near the exponential of the filters' flow over one period."""
    n = len(step[1])
    generator = fmpq_mat(n + 1, n + 1)
    for i in range(n):
        for j in range(n):
            generator[i, j] = period * flow[0][i, j]
        generator[i, n] = period * flow[1][i]
    exact = arb_mat(generator).exp()
    largest = max(exact[i, j].abs_upper() for i in range(n) for j in range(n + 1))
    for i, row in enumerate(step[0].tolist()):
        for j, value in enumerate([*row, step[1][i]]):
            if not abs(exact[i, j] - value) <= STEP_TOLERANCE * largest:
                place = f"observer_transition/{i}/{j}" if j < n else f"observer_input/{i}"
                raise DocumentError(f"/timing/{place}", "is not the step of the stated observer")


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


def _energy_input(reader: Reader, K: fmpq, h: fmpq, a: tuple[fmpq, ...], others: int) -> fmpq_mat:
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
    return fmpq_mat(L.tolist() + [[fmpq(0), fmpq(0)]] * others)


def _positive(reader: Reader, pointer: str) -> fmpq:
    value = reader.rational(pointer)
    if value <= 0:
        raise DocumentError(pointer, "must be positive")
    return value


def _name(values: tuple[fmpq, ...]) -> str:
    digits = ", ".join(f"{int(v.p) / int(v.q):.4g}" for v in values)
    return f"the corner (r1', s0, …, Ks/b0) = ({digits}), scaled"
