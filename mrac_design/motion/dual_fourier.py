"""Heart motion as a Fourier series in two phases, cardiac and respiratory.

x(t) = Σ_ij C_ij u_i(φc(t)) v_j(φr(t)) + Σ_m z_m(t) Σ_i M_mi u_i(φc(t))

u, v are 1, cos 2πφ, sin 2πφ, cos 4πφ, …. Products u_i v_j with i, j > 0 let breathing change
the shape of the beat. Beats differ in length (the rhythm) and in shape (scores z_m, constant
within a beat and blended from one to the next).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.motion.heart import HeartMotion, Origin, centred_motion
from mrac_design.motion.jets import Jet, harmonics, smooth_phase, smooth_steps
from mrac_design.motion.rhythm import Rhythm, cardiac_phase, correlated_scores
from mrac_design.motion.signal import quintic_hermite

NODE_SPACING = 0.005
"""Distance of the nodes of a generated motion, s: the quintic error stays under 1 nm
for motion of a few mm up to 10 Hz, and the segments stay longer than an integrator's step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Breathing:
    """Ventilation at a constant rate, which may be held from some instant on."""

    frequency: float
    """Breaths a second f_r, Hz."""
    stop: float | None = None
    """Middle of the slowing down, s; None while breathing goes on."""
    fade: float = 1.0
    """Time in which breathing comes to rest, s."""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.frequency) and self.frequency > 0.0):
            raise ParameterError("breathing frequency", self.frequency, "must be positive, in Hz")
        if not (np.isfinite(self.fade) and self.fade > 0.0):
            raise ParameterError("breathing fade", self.fade, "must be a positive time in s")
        if self.stop is not None and not (np.isfinite(self.stop) and self.stop >= 0.5 * self.fade):
            raise ParameterError("breathing stop", self.stop, "must be at least half the fade")

    def phase(self, t: FloatArray) -> Jet:
        """Respiratory phase in breaths at `t` (N,), s."""
        if self.stop is None:
            return smooth_phase(t, np.empty(0), np.array([self.frequency]), self.fade)
        return smooth_phase(t, np.array([self.stop]), np.array([self.frequency, 0.0]), self.fade)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeatVariation:
    """How the shape of a beat strays from beat to beat, as independent modes."""

    modes: FloatArray
    """Change of the cardiac coefficients for a score of one, m, (modes, 3, 2·harmonics + 1)."""
    correlations: FloatArray
    """Correlation of a mode's score with that of the beat before, (modes,), |r| < 1."""

    def __post_init__(self) -> None:
        modes, correlations = np.asarray(self.modes), np.asarray(self.correlations)
        if modes.ndim != 3 or modes.shape[1] != 3 or modes.shape[2] % 2 == 0:
            raise ParameterError("modes", modes.shape, "must be (modes, 3, 2·harmonics + 1)")
        if correlations.shape != modes.shape[:1] or not (np.abs(correlations) < 1.0).all():
            raise ParameterError("correlations", correlations, "needs one |r| < 1 for each mode")
        object.__setattr__(self, "modes", readonly(modes))
        object.__setattr__(self, "correlations", readonly(correlations))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DualFourierModel:
    """A heart motion of any length, the same for the same seed."""

    name: str
    """Short name, as shown in tables."""
    origin: Origin
    """FITTED or ASSUMED."""
    source: str
    """Where the coefficients come from."""
    assumptions: tuple[str, ...]
    """Everything that had to be assumed, one sentence each."""
    coefficients: FloatArray
    """C, m, (3, 2·cardiac harmonics + 1, 2·respiratory harmonics + 1)."""
    rhythm: Rhythm
    """When the beats come."""
    systole: float
    """Start of a beat that keeps its duration however long the beat, s."""
    breathing: Breathing
    """Respiratory rate."""
    variation: BeatVariation | None
    """Beat-to-beat change of shape; None for beats of one shape."""
    seed: int
    """Seed of every random number of the motion."""

    def __post_init__(self) -> None:
        shape = np.shape(self.coefficients)
        if len(shape) != 3 or shape[0] != 3 or shape[1] % 2 == 0 or shape[2] % 2 == 0:
            raise ParameterError(
                "coefficients", shape, "must be (3, 2·cardiac + 1, 2·respiratory + 1)"
            )
        if not 0.0 <= self.systole < self.rhythm.mean_period:
            raise ParameterError(
                "systole", self.systole, f"must lie in 0 … {self.rhythm.mean_period:g} s, one beat"
            )
        if self.seed < 0:
            raise ParameterError("seed", self.seed, "must be 0 or more")
        object.__setattr__(self, "coefficients", readonly(self.coefficients))
        object.__setattr__(self, "assumptions", tuple(self.assumptions))

    def displacement(self, t: FloatArray) -> Jet:
        """Closed form at increasing instants `t` (N,) ≥ 0, s: (3, N) in m, m/s and m/s²."""
        intervals = self._intervals(float(t[-1]))
        phase = cardiac_phase(
            t, intervals, mean_period=self.rhythm.mean_period, systole=self.systole
        )
        rows, columns = self.coefficients.shape[1:]
        cardiac = harmonics(phase, rows // 2)
        respiratory = harmonics(self.breathing.phase(t), columns // 2)
        total = (respiratory.combined(self.coefficients) * cardiac).summed(1)
        if self.variation is None:
            return total
        shape = self.variation.modes.shape
        scores = correlated_scores(intervals.size, self.variation.correlations, self._random(1))
        blended = smooth_steps(t, np.cumsum(intervals)[:-1], scores, 0.5 * self.rhythm.mean_period)
        change = harmonics(phase, shape[2] // 2).combined(self.variation.modes)
        spread = Jet(
            value=blended.value[:, None, :],
            rate=blended.rate[:, None, :],
            second_rate=blended.second_rate[:, None, :],
        )
        return total + (spread * change).summed(0)

    def onsets(self, duration: float) -> FloatArray:
        """Instants at which the beats of a motion of `duration` s start, s, from 0 on."""
        starts = np.concatenate(([0.0], np.cumsum(self._intervals(duration))))
        inside: FloatArray = starts[starts < duration]
        return inside

    def motion(self, duration: float) -> HeartMotion:
        """The motion over [0, duration] s as a quintic Hermite polynomial, zero mean.

        Raises ParameterError unless `duration` is a positive time.
        """
        if not (np.isfinite(duration) and duration > 0.0):
            raise ParameterError("duration", duration, "must be a positive time in s")
        # Multiples of the spacing coincide with sampling instants; the last segment is 0.5 to
        # 1.5 spacings long.
        count = max(1, round(duration / NODE_SPACING))
        nodes = np.append(np.arange(count) * NODE_SPACING, duration)
        jet = self.displacement(nodes)
        return centred_motion(
            name=self.name,
            origin=self.origin,
            source=self.source,
            assumptions=self.assumptions,
            displacement=quintic_hermite(nodes, jet.value, jet.rate, jet.second_rate),
        )

    def with_seed(self, seed: int) -> DualFourierModel:
        """The same model with other random numbers."""
        return replace(self, seed=seed)

    def _intervals(self, duration: float) -> FloatArray:
        """Beat lengths that reach past `duration`, s."""
        count = int(np.ceil(duration / self.rhythm.mean_period)) + 2
        while True:
            lengths = self.rhythm.intervals(count, self._random(0))
            # Two beats more than needed keep every blend that starts before the end.
            if lengths[:-2].sum() > duration:
                return lengths
            count *= 2

    def _random(self, stream: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, stream])
