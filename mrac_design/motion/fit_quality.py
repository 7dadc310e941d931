"""How well a fitted motion model fits: residuals on held-back frames, likeness of statistics."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from mrac_design.arrays import FloatArray
from mrac_design.motion.dual_fourier import DualFourierModel
from mrac_design.motion.fit_series import Recording
from mrac_design.motion.heart import HeartMotion, Origin, centred_motion
from mrac_design.motion.signal import from_ppoly

BANDS = (0.0, 0.5, 1.2, 2.5, 5.0, 8.0)
"""Borders of the frequency bands in which motions are compared, Hz."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Residual:
    """What a model leaves of the recording, for one way of telling it the beat times."""

    beat_times: str
    """Where the model has the beat times from."""
    training_rms: FloatArray
    """Residual on the training frames, m, (3,)."""
    held_back_rms: FloatArray
    """Residual on the held-back frames, m, (3,)."""
    training_explained: FloatArray
    """1 − mean square residual / variance, training frames, (3,)."""
    held_back_explained: FloatArray
    """The same on the held-back frames, (3,); negative where the mean would do better."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotionStatistics:
    """What a controller feels of a motion."""

    peak_to_peak: FloatArray
    """Largest minus smallest displacement, m, (3,)."""
    peak_velocity: FloatArray
    """Largest |velocity|, m/s, (3,)."""
    rms_velocity: FloatArray
    """Root mean square velocity, m/s, (3,)."""
    peak_acceleration: FloatArray
    """Largest |acceleration|, m/s², (3,)."""
    rms_acceleration: FloatArray
    """Root mean square acceleration, m/s², (3,)."""
    band_rms: FloatArray
    """Root mean square displacement in each band of BANDS, m, (3, bands)."""


def residual_of(recording: Recording, predicted: FloatArray, beat_times: str) -> Residual:
    """Residual of `predicted` (frames, 3), m, on both parts of `recording`."""
    error = recording.position - predicted
    parts = (slice(0, recording.training), slice(recording.training, None))
    rms = [np.sqrt(np.mean(error[part] ** 2, axis=0)) for part in parts]
    deviation = [recording.position[part].std(axis=0) for part in parts]
    explained = [1.0 - (r / d) ** 2 for r, d in zip(rms, deviation, strict=True)]
    return Residual(
        beat_times=beat_times,
        training_rms=rms[0],
        held_back_rms=rms[1],
        training_explained=explained[0],
        held_back_explained=explained[1],
    )


def recorded_statistics(recording: Recording) -> MotionStatistics:
    """Statistics of all frames of `recording`, splined."""
    motion = centred_motion(
        name="recording",
        origin=Origin.RECORDED,
        source="",
        assumptions=(),
        displacement=from_ppoly(CubicSpline(recording.time, recording.position)),
    )
    return _statistics(motion)


def generated_statistics(
    model: DualFourierModel, duration: float, seeds: range
) -> MotionStatistics:
    """Mean over `seeds` of the statistics of motions of `duration` s."""
    every = [_statistics(model.with_seed(seed).motion(duration)) for seed in seeds]
    return MotionStatistics(
        peak_to_peak=np.mean([item.peak_to_peak for item in every], axis=0),
        peak_velocity=np.mean([item.peak_velocity for item in every], axis=0),
        rms_velocity=np.mean([item.rms_velocity for item in every], axis=0),
        peak_acceleration=np.mean([item.peak_acceleration for item in every], axis=0),
        rms_acceleration=np.mean([item.rms_acceleration for item in every], axis=0),
        band_rms=np.sqrt(np.mean([item.band_rms**2 for item in every], axis=0)),
    )


def _statistics(motion: HeartMotion) -> MotionStatistics:
    """Statistics of one motion, sampled at 200 Hz where a mean is needed."""
    count = int(motion.duration * 200.0)
    t = np.arange(count) / 200.0
    velocity = motion.displacement.derivative()
    window = np.hanning(count)
    spectrum = np.fft.rfft(motion.displacement(t) * window, axis=1)
    power = 2.0 * np.abs(spectrum) ** 2 / (count * np.sum(window**2))
    frequency = np.fft.rfftfreq(count, 1.0 / 200.0)
    bands = [
        np.sqrt(power[:, (frequency >= low) & (frequency < high)].sum(axis=1))
        for low, high in pairwise(BANDS)
    ]
    return MotionStatistics(
        peak_to_peak=motion.peak_to_peak,
        peak_velocity=motion.peak_velocity,
        rms_velocity=np.sqrt(np.mean(velocity(t) ** 2, axis=1)),
        peak_acceleration=motion.peak_acceleration,
        rms_acceleration=np.sqrt(np.mean(velocity.derivative()(t) ** 2, axis=1)),
        band_rms=np.stack(bands, axis=1),
    )
