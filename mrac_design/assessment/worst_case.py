"""Hostile simulation against certified bounds: how close does anything come to what was proved?

The gains (and the stiffness) jump at will between points of the certified box, by chance or chosen
by an adversary, and the disturbance d = Ẍh + K2 Ẋh is the worst for that very path. The equations
are those of the axis in SI units, integrated by matrix exponentials over short spans in which all
is constant; nothing of the certificate's own matrices is used but its Lyapunov matrices, which
tell the adversary where it hurts. What is found is a lower bound of the true worst case.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from mrac_design.arrays import FloatArray, readonly
from mrac_design.assessment.axis_filters import axis_filters
from mrac_design.errors import ParameterError
from mrac_design.stability import Sampling, StabilityCertificate
from mrac_design.stability.exact_matrix import to_floats
from mrac_design.stability.rational_function import to_float

SUBSTEPS = 4
"""Spans of constant disturbance in one span of constant gains."""

POWER_STEPS = 40
"""Steps of the power iteration for the worst disturbance of a path."""

SPAN = 0.25
"""Length of a span of constant gains in a continuous loop, in units of 1/ω."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """A certified bound beside the worst that simulation found."""

    name: str
    """What is bounded."""
    unit: str
    """Unit of both."""
    bound: float
    """Certified bound."""
    simulated: float
    """Worst value found."""
    trials: int
    """Paths tried."""

    @property
    def ratio(self) -> float:
        """Bound over simulated: 1 would be tight, below 1 the certificate would be wrong."""
        return self.bound / self.simulated


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WorstCases:
    """Every certified bound beside simulation."""

    comparisons: tuple[Comparison, ...]
    """Peak, energy and decay."""

    @property
    def exceeded(self) -> tuple[Comparison, ...]:
        """Comparisons in which simulation is worse than the bound; empty if all is well."""
        return tuple(item for item in self.comparisons if item.ratio < 1)

    def _repr_markdown_(self) -> str:
        lines = ["| certified | bound | worst simulated | ratio | paths |", "|---|--:|--:|--:|--:|"]
        lines += [
            f"| {c.name} | {c.bound:.4g} {c.unit} | {c.simulated:.4g} {c.unit} "
            f"| {c.ratio:.3g} | {c.trials} |"
            for c in self.comparisons
        ]
        return "\n".join(lines)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Spans:
    """What the loop does in one span, for each of c points of the box."""

    transition: FloatArray
    """State to state, (c, n, n)."""
    effect: FloatArray
    """Disturbance in each part of the span to the state at its end, (c, n, m)."""
    rows: FloatArray
    """State to the force at the end of each part, (c, m, n)."""
    direct: FloatArray
    """Disturbance in each part to those forces, (c, m, m), lower triangular."""
    corners: int
    """The first so many points are corners of the box."""
    duration: float
    """Length of the span (s)."""
    sampled: bool
    """Whether the certificate counts the force at the span's end only."""


def worst_cases(
    certificate: StabilityCertificate, *, paths: int, spans: int, seed: int
) -> WorstCases:
    """Try `paths` paths of `spans` spans each against every bound of a certificate.

    Half of the paths are random, half follow an adversary. Bounds that were not proved are left
    out. Raises ParameterError for numbers
    below 2, or a certificate without proof.
    """
    if paths < 2 or spans < 2:
        raise ParameterError("worst cases", (paths, spans), "needs at least 2 paths of 2 spans")
    if certificate.decay is None:
        raise ParameterError("certificate", certificate.verdict.value, "needs one that is proved")
    rng = np.random.default_rng(seed)
    loops = _spans(certificate, _points(certificate, rng))
    scale = _state_scale(certificate)
    lyapunov = scale[:, None] * to_floats(certificate.decay.P) * scale
    hurting = certificate.peak or certificate.decay
    metric = readonly(np.linalg.inv(scale[:, None] * to_floats(hurting.P) * scale))
    found = list(_paths(loops, metric, paths, spans, rng))
    rates = [_slowest_decay(loops, lyapunov, 4 * spans, rng) for _ in range(max(2, paths // 4))]
    decay = Comparison(
        name="time constant of the decay",
        unit="s",
        bound=1 / certificate.decay_rate,
        simulated=1 / min(rates),
        trials=len(rates),
    )
    gains = [
        Comparison(
            name=name,
            unit="N/(m/s²)",
            bound=bound,
            simulated=max(response(loops, path) for path in found),
            trials=len(found),
        )
        for name, claim, bound, response in (
            ("peak force per peak of $d$", certificate.peak, certificate.peak_gain, _worst_peak),
            (
                "energy of the force per energy of $d$",
                certificate.energy,
                certificate.energy_gain,
                _worst_energy,
            ),
        )
        if claim is not None
    ]
    return WorstCases(comparisons=(*gains, decay))


def _points(certificate: StabilityCertificate, rng: np.random.Generator) -> FloatArray:
    """SI values (r1', s0, …, sn, Ks): all corners of the box, then points inside, (c, n + 3)."""
    loop, box = certificate.loop, certificate.box
    units = np.array([*(to_float(d) for d in loop.gain_scale), to_float(loop.design_stiffness)])
    corners = np.array([[to_float(v) for v in corner] for corner in box.corners()])
    low, high = corners.min(axis=0), corners.max(axis=0)
    inside = low + (high - low) * rng.random((16, len(low)))
    return np.asarray(np.vstack([corners, inside]) * units)


def _spans(certificate: StabilityCertificate, points: FloatArray) -> _Spans:
    corners = sum(1 for _ in certificate.box.corners())
    if isinstance(certificate.timing, Sampling):
        return _sampled_spans(certificate, certificate.timing, points, corners)
    return _continuous_spans(certificate, points, corners)


def _continuous_spans(
    certificate: StabilityCertificate, points: FloatArray, corners: int
) -> _Spans:
    filters = axis_filters(certificate.loop)
    n, (chain, drive) = filters.degree, filters.flow
    own = 2 + 2 * n
    block = np.zeros((len(points), own + 1, own + 1))
    block[:, 0, 1] = 1
    block[:, 1, 1], block[:, 1, own] = -to_float(certificate.loop.velocity_gain), -1
    block[:, 2 : 2 + n, 2 : 2 + n] = block[:, 2 + n : own, 2 + n : own] = chain
    for matrix, point in zip(block, points, strict=True):
        command = filters.command(point)
        matrix[1, :own] += command
        matrix[2 : 2 + n, :own] += drive @ command[None]
    block[:, 2 + n, 0] = points[:, -1]
    duration = SPAN / to_float(certificate.loop.bandwidth)
    flow = expm(block * (duration / SUBSTEPS))
    force = np.zeros((len(points), own))
    force[:, 0] = points[:, -1]
    return _composed(
        flow[:, :own, :own], flow[:, :own, own], force, corners, duration, sampled=False
    )


def _sampled_spans(
    certificate: StabilityCertificate, timing: Sampling, points: FloatArray, corners: int
) -> _Spans:
    """One sampling period: the command is read off at its start, applied `delay` later, held."""
    filters = axis_filters(certificate.loop)
    n, (chain, drive) = filters.degree, filters.flow
    own = 2 + 2 * n
    period, size = to_float(timing.period), own + timing.delay
    plant = np.zeros((4, 4))
    plant[0, 1], plant[1, 2:] = 1, (1, -1)
    plant[1, 1] = -to_float(certificate.loop.velocity_gain)
    part = expm(plant * (period / SUBSTEPS))
    held = expm(np.block([[chain, drive], [np.zeros((1, n + 1))]]) * period)
    move, push = held[:n, :n], held[:n, n]
    count, unit = len(points), np.eye(size)
    # State within the period: (ξ, ξ', applied command); before it: (ξ, ξ', x_u, x_y, u₋₁, …).
    begin = np.zeros((count, 3, size))
    later = np.zeros((count, size - 2, size))
    force = np.zeros((count, 3))
    for i, point in enumerate(points):
        command = np.concatenate([filters.command(point), np.zeros(timing.delay)])
        begin[i] = np.vstack([unit[:2], unit[size - 1] if timing.delay else command])
        later[i, :n, 2 : 2 + n] = later[i, n : 2 * n, 2 + n : own] = move
        later[i, :n] += np.outer(push, command)
        later[i, n : 2 * n, 0] += push * point[-1]
        if timing.delay:
            later[i, 2 * n] = command
            later[i, 2 * n + 1 :] = unit[own : size - 1]
        force[i, 0] = point[-1]
    steps = np.eye(3)
    steps[:2] = part[:2, :3]
    inside = _composed(
        np.tile(steps, (count, 1, 1)), np.tile(np.array([*part[:2, 3], 0.0]), (count, 1)), force,
        corners, period, sampled=True,
    )  # fmt: skip
    effect = np.zeros((count, size, SUBSTEPS))
    effect[:, :2] = inside.effect[:, :2]
    return _Spans(
        transition=np.concatenate([inside.transition[:, :2] @ begin, later], axis=1),
        effect=effect,
        rows=inside.rows @ begin,
        direct=inside.direct,
        corners=corners,
        duration=period,
        sampled=True,
    )


def _composed(
    flow: FloatArray,
    kick: FloatArray,
    force: FloatArray,
    corners: int,
    duration: float,
    *,
    sampled: bool,
) -> _Spans:
    """Spans of SUBSTEPS equal parts with transition (c, n, n), effect (c, n) and force (c, n)."""
    count, n, _ = flow.shape
    transition = np.tile(np.eye(n), (count, 1, 1))
    effect = np.zeros((count, n, SUBSTEPS))
    rows, direct = np.zeros((count, SUBSTEPS, n)), np.zeros((count, SUBSTEPS, SUBSTEPS))
    for part in range(SUBSTEPS):
        transition, effect = flow @ transition, flow @ effect
        effect[:, :, part] += kick
        rows[:, part] = np.einsum("cn,cnk->ck", force, transition)
        direct[:, part] = np.einsum("cn,cnk->ck", force, effect)
    return _Spans(
        transition=transition,
        effect=effect,
        rows=rows,
        direct=direct,
        corners=corners,
        duration=duration,
        sampled=sampled,
    )


def _paths(
    loops: _Spans, metric: FloatArray, paths: int, spans: int, rng: np.random.Generator
) -> Iterator[NDArray[np.int_]]:
    """Point of the box in every span, (spans,): random paths, then an adversary's."""
    for number in range(paths):
        if number < paths // 2:
            hold = int(rng.integers(1, max(2, spans // 4)))
            pool = loops.corners if rng.random() < 0.7 else len(loops.transition)
            yield np.repeat(rng.integers(pool, size=-(-spans // hold)), hold)[:spans]
        else:
            weight = 10.0 ** rng.uniform(-1, 1)
            yield _adversarial_path(loops, metric, spans, weight, int(rng.integers(loops.corners)))


def _adversarial_path(
    loops: _Spans, metric: FloatArray, spans: int, weight: float, last: int
) -> NDArray[np.int_]:
    """Backwards from the force at the end: each corner the one that lets most through.

    What a disturbance can do at once counts fully, what may still be done earlier by the norm of
    the remaining row in the metric of the invariant ellipsoid, with `weight`.
    """
    path = np.empty(spans, dtype=int)
    path[-1] = last
    row = loops.rows[last, -1]
    corners = slice(0, loops.corners)
    for k in range(spans - 2, -1, -1):
        before = row @ loops.transition[corners]
        now = np.abs(row @ loops.effect[corners]).sum(axis=1)
        reserve = np.sqrt(np.einsum("cn,nk,ck->c", before, metric, before))
        path[k] = int(np.argmax(now + weight * now.mean() / reserve.mean() * reserve))
        row = before[path[k]]
    return path


def _worst_peak(loops: _Spans, path: NDArray[np.int_]) -> float:
    """Largest |force| at the path's end for the worst |d| <= 1 before it, over the last spans."""
    best = 0.0
    last = path[-1]
    for part in range(SUBSTEPS):
        row = loops.rows[last, part]
        total = float(np.abs(loops.direct[last, part]).sum())
        for point in path[-2::-1]:
            total += float(np.abs(row @ loops.effect[point]).sum())
            row = row @ loops.transition[point]
        best = max(best, total)
    return best


def _worst_energy(loops: _Spans, path: NDArray[np.int_]) -> float:
    """Largest ratio of the norms of force and disturbance along a path, from rest."""
    parts = [SUBSTEPS - 1] if loops.sampled else list(range(SUBSTEPS))
    n = loops.transition.shape[1]
    response = np.zeros((n, len(path) * SUBSTEPS))
    lifted = np.zeros((len(path) * len(parts), len(path) * SUBSTEPS))
    for k, point in enumerate(path):
        at, own = (
            slice(k * len(parts), (k + 1) * len(parts)),
            slice(k * SUBSTEPS, (k + 1) * SUBSTEPS),
        )
        lifted[at] = loops.rows[point][parts] @ response
        lifted[at, own] += loops.direct[point][parts]
        response = loops.transition[point] @ response
        response[:, own] = loops.effect[point]
    # Sampled: the force counts with a whole period, the disturbance with the part it acts in.
    share = SUBSTEPS if loops.sampled else 1
    # Power iteration: after any number of steps a ratio that a disturbance really reaches.
    gain, disturbance = 0.0, np.ones(lifted.shape[1])
    for _ in range(POWER_STEPS):
        force = lifted @ (disturbance / float(np.linalg.norm(disturbance)))
        gain = float(np.linalg.norm(force))
        disturbance = lifted.T @ force
    return gain * float(np.sqrt(share))


def _slowest_decay(
    loops: _Spans, lyapunov: FloatArray, spans: int, rng: np.random.Generator
) -> float:
    """Decay rate (1/s) of a deviation along a path that keeps V as high as it can."""
    x: FloatArray = np.asarray(rng.standard_normal(loops.transition.shape[1]))
    x /= np.sqrt(x @ lyapunov @ x)
    fallen = 0.0
    for _ in range(spans):
        after = loops.transition[: loops.corners] @ x
        size = np.sqrt(np.einsum("cn,nk,ck->c", after, lyapunov, after))
        worst = int(np.argmax(size))
        fallen -= float(np.log(size[worst]))
        x = after[worst] / size[worst]
    return fallen / (spans * loops.duration)


def _state_scale(certificate: StabilityCertificate) -> FloatArray:
    """Scaled state over SI state: (ŷ, Ẑ, x̂u, x̂y, û…) = scale · (ξ, ξ', x_u, x_y, u…)."""
    b0, omega = (
        to_float(v) for v in (certificate.loop.design_stiffness, certificate.loop.bandwidth)
    )
    delay = certificate.timing.delay if isinstance(certificate.timing, Sampling) else 0
    filters, command = omega ** np.arange(1.0, certificate.loop.degree + 1), b0 / omega**2
    return np.array([b0, b0 / omega, *(command * filters), *filters, *[command] * delay])
