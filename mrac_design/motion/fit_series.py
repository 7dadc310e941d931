"""Least-squares fits of Fourier series in the cardiac and respiratory phases of a recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.motion.dual_fourier import BeatVariation
from mrac_design.motion.jets import Jet, harmonics, smooth_phase, smooth_steps
from mrac_design.motion.rhythm import cardiac_phase

CARDIAC_HARMONICS = 8
"""Harmonics of the beat: at 50 beats a minute the eighth lies at 6.8 Hz, under the filter."""
RESPIRATORY_HARMONICS = 3
"""Harmonics of the breath."""
MODULATION_HARMONICS = 1
"""Harmonics of the breath that multiply those of the beat."""
VARIATION_HARMONICS = 8
"""Harmonics of the beat whose coefficients vary from beat to beat."""
VARIATION_MODES = 8
"""Independent ways in which they vary."""
RIDGE = 1e-3
"""Weight of the coefficients' squares beside the mean square residual."""
VARIATION_RIDGE = 1e-2
"""The same for the coefficients of single beats, which have few frames each."""
SLOWEST_BREATH, FASTEST_BREATH = 0.1, 0.5
"""Range in which the respiratory frequency is looked for, Hz."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """A filtered track, split into frames to fit and frames to judge by."""

    position: FloatArray
    """x, y, z less their mean over the training frames, m, (frames, 3)."""
    frame_rate: float
    """Frames a second, Hz."""
    training: int
    """Number of leading frames that are fitted; the rest are held back."""

    def __post_init__(self) -> None:
        position = readonly(self.position, (-1, 3))
        if not 1 < self.training < position.shape[0]:
            raise ParameterError(
                "training",
                self.training,
                f"must leave some of {position.shape[0]} frames for judging",
            )
        mean = position[: self.training].mean(axis=0)
        object.__setattr__(self, "position", readonly(position - mean))

    @property
    def time(self) -> FloatArray:
        """Instant of each frame, s, (frames,)."""
        return np.arange(self.position.shape[0]) / self.frame_rate

    @property
    def training_time(self) -> float:
        """Instant at which the held-back frames begin, s."""
        return self.training / self.frame_rate


def steady_phase(t: FloatArray, frequency: float) -> Jet:
    """Phase of a clock of one `frequency`, Hz, cycles, (N,)."""
    return smooth_phase(t, np.empty(0), np.array([frequency]), 1.0)


def beat_phase(t: FloatArray, onsets: FloatArray, *, period: float, systole: float) -> Jet:
    """Cardiac phase at `t` (N,) ≥ 0 for beats at `onsets`, s, mean beats before and after them."""
    before = max(1, int(np.ceil(onsets[0] / period)))
    after = max(2, int(np.ceil((t[-1] - onsets[-1]) / period)) + 1)
    extended = np.concatenate(
        (
            onsets[0] - period * np.arange(before, 0, -1),
            onsets,
            onsets[-1] + period * np.arange(1, after + 1),
        )
    )
    return cardiac_phase(t - extended[0], np.diff(extended), mean_period=period, systole=systole)


def series_basis(cardiac: Jet, respiratory: Jet) -> FloatArray:
    """Products u_i v_j that are fitted, (functions, N), in the order of `series_slots`."""
    u = harmonics(cardiac, CARDIAC_HARMONICS).value
    v = harmonics(respiratory, RESPIRATORY_HARMONICS).value
    return np.stack([u[i] * v[j] for i, j in series_slots()])


def series_slots() -> list[tuple[int, int]]:
    """Places (i, j) of the fitted coefficients; all others are zero."""
    return [
        (i, j)
        for i in range(2 * CARDIAC_HARMONICS + 1)
        for j in range(2 * RESPIRATORY_HARMONICS + 1)
        if i == 0 or j <= 2 * MODULATION_HARMONICS
    ]


def ridge_fit(basis: FloatArray, target: FloatArray, ridge: float) -> FloatArray:
    """Weights (functions, 3) of `basis` (functions, N) for `target` (N, 3)."""
    normal = basis @ basis.T + ridge * basis.shape[1] * np.eye(basis.shape[0])
    weights: FloatArray = np.linalg.solve(normal, basis @ target)
    return weights


def fit_series(recording: Recording, cardiac: Jet, respiratory: Jet) -> FloatArray:
    """Coefficients C, m, (3, 2·cardiac + 1, 2·respiratory + 1), from the training frames."""
    basis = series_basis(cardiac, respiratory)[:, : recording.training]
    weights = ridge_fit(basis, recording.position[: recording.training], RIDGE)
    coefficients = np.zeros((3, 2 * CARDIAC_HARMONICS + 1, 2 * RESPIRATORY_HARMONICS + 1))
    for (i, j), weight in zip(series_slots(), weights, strict=True):
        coefficients[:, i, j] = weight
    return coefficients


def series_values(coefficients: FloatArray, cardiac: Jet, respiratory: Jet) -> FloatArray:
    """The series with `coefficients` C at the phases, m, (N, 3)."""
    u = harmonics(cardiac, coefficients.shape[1] // 2).value
    v = harmonics(respiratory, coefficients.shape[2] // 2).value
    values: FloatArray = np.einsum("aij,in,jn->na", coefficients, u, v)
    return values


def breathing_frequency(recording: Recording) -> float:
    """Frequency whose harmonics explain most, near the strongest single one, Hz."""
    t, y = recording.time[: recording.training], recording.position[: recording.training]

    def unexplained(frequency: float, count: int) -> float:
        basis = harmonics(steady_phase(t, frequency), count).value
        return float(np.mean((y - basis.T @ ridge_fit(basis, y, 1e-9)) ** 2))

    coarse = np.arange(SLOWEST_BREATH, FASTEST_BREATH, 0.005)
    first = coarse[int(np.argmin([unexplained(item, 1) for item in coarse]))]
    fine = first * np.linspace(0.93, 1.07, 141)
    costs = [unexplained(item, RESPIRATORY_HARMONICS) for item in fine]
    return float(fine[int(np.argmin(costs))])


def fit_variation(
    residual: FloatArray, t: FloatArray, onsets: FloatArray, cardiac: Jet, period: float
) -> BeatVariation:
    """Principal modes of the beat-to-beat change in `residual` (N, 3), m, at `t` (N,), s.

    Each beat of `onsets` gets its own cardiac coefficients, blended from beat to beat as in
    DualFourierModel; the modes are the principal components of these.
    """
    levels = np.eye(onsets.size)
    weights = smooth_steps(t, onsets[1:], levels, 0.5 * period).value
    u = harmonics(cardiac, VARIATION_HARMONICS).value
    basis = (weights[:, None, :] * u[None, :, :]).reshape(-1, t.size)
    single = ridge_fit(basis, residual, VARIATION_RIDGE / onsets.size)
    # (beats, functions, 3) → one row a beat, axis before function as in the model.
    rows = single.reshape(onsets.size, u.shape[0], 3).transpose(0, 2, 1)
    table = rows.reshape(onsets.size, -1)
    scores, sizes, shapes = np.linalg.svd(table - table.mean(axis=0), full_matrices=False)
    count = min(VARIATION_MODES, onsets.size - 2)
    scale = sizes[:count] / np.sqrt(onsets.size - 1)
    modes = (scale[:, None] * shapes[:count]).reshape(count, 3, u.shape[0])
    correlations = np.array([lag_one_correlation(scores[:, mode]) for mode in range(count)])
    return BeatVariation(modes=modes, correlations=correlations)


def lag_one_correlation(values: FloatArray) -> float:
    """Correlation of successive values of a sequence, limited to ±0.95."""
    centred = values - values.mean()
    correlation = float(centred[1:] @ centred[:-1] / (centred @ centred))
    return float(np.clip(correlation, -0.95, 0.95))
