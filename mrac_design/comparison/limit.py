r"""The least force error any linear causal controller can reach on a motion's spectrum.

A command computed from the reading at k moves the force from k + d + 1 on, d the dead time in
samples. The reading minus the known effect of past commands is d(k) + v(k): the force the motion
alone would cause, and sensor noise. Whatever a linear law does, at k + d + 1 it is left with at
least what cannot be predicted of d from those readings,

    E² = r(0) − rᵀ (R + σ² I)⁻¹ r,     r = (r(a), …, r(a + m − 1)),  a = d + 1,

R the Toeplitz matrix of the autocovariance r(τ) of d. The plant's sampled inverse is stable, so
u can be chosen to reach it: this is linear-quadratic Gaussian control at no cost of command, with
the motion's spectrum known. (Åström 1970, ch. 6; Wiener 1949.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import matmul_toeplitz, solve_toeplitz

from mrac_design.arrays import FloatArray, readonly
from mrac_design.comparison.setting import AxisSetting
from mrac_design.errors import ParameterError
from mrac_design.motion.signal import PiecewisePolynomial

MEMORY = 1500
"""Past readings the best predictor may use: 1.5 s at 1 kHz, more than a beat. Twice as many lower
the limit by about one per cent."""

ASSUMPTIONS = (
    "The motion is a stationary Gaussian process whose spectrum the controller knows: that of the "
    "motion itself, seen through a Hann window.",
    "Noise of the sensor is white; quantisation counts as independent uniform noise.",
    "Plant, stiffness and dead time are known exactly; the command costs nothing and has no bound.",
    "The desired force is known in advance.",
    "Errors count at the sampling instants, long after the start.",
)
"""What the limit rests on, one sentence each."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MotionSpectrum:
    """Power spectrum of a motion as lines of a periodic one."""

    frequency: FloatArray
    """Frequencies of the lines (Hz), ascending from 0, (lines,)."""
    power: FloatArray
    """Mean square of each line (m²), (lines,)."""
    period: float
    """Sampling period (s) of the motion it was measured from."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "frequency", readonly(self.frequency, (-1,)))
        object.__setattr__(self, "power", readonly(self.power, (self.frequency.size,)))

    def autocovariance(self, count: int) -> FloatArray:
        """Autocovariance (m²) at lags 0 … count − 1 sampling periods, (count,)."""
        length = 2 * (self.frequency.size - 1)
        if count > length // 2:
            raise ParameterError("lags", count, f"must be at most {length // 2}")
        halves = self.power / 2.0
        halves[0], halves[-1] = self.power[0], self.power[-1]
        return readonly(np.fft.irfft(halves * length)[:count])

    def realisation(
        self, instants: FloatArray, *, seed: int
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """A Gaussian motion of this spectrum: m, m/s and m/s² at `instants` (N,), s."""
        random = np.random.default_rng(seed)
        # Lines without power would cost most of the time.
        used = np.flatnonzero(self.power > 1e-12 * self.power.max())
        scale = np.sqrt(self.power[used] / 2.0)
        factors = scale * (
            random.standard_normal(used.size) + 1j * random.standard_normal(used.size)
        )
        w = 2.0 * np.pi * self.frequency[used]
        waves = np.exp(1j * np.outer(instants, w))
        value, rate, second = (np.real(waves @ (factors * (1j * w) ** order)) for order in range(3))
        return value, rate, second


def motion_spectrum(
    motion: PiecewisePolynomial, *, end: float, period: float, start: float = 0.0
) -> MotionSpectrum:
    """Spectrum of a one-channel motion (m) between `start` and `end` (s), under a Hann window."""
    count = int(np.floor((end - start) / period + 1e-9))
    if count < 2 * MEMORY:
        raise ParameterError("motion", f"{end - start:g} s", "is too short for its spectrum")
    samples = motion(start + period * np.arange(count))[0]
    window = np.hanning(count)
    # The mean the window sees: what is left would leak into every line.
    samples = samples - (window @ samples) / window.sum()
    length = 2 * count  # padded, so that the correlation does not wrap round
    lines = np.fft.rfft(window * samples, length)
    power = np.abs(lines) ** 2 / (length * (window**2).sum())
    power[1:-1] *= 2.0
    return MotionSpectrum(
        frequency=readonly(np.fft.rfftfreq(length, period)), power=power, period=period
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearLimit:
    """The best linear predictor for a noise level, and what it leaves."""

    noise: float
    """Standard deviation of the readings' noise it is made for (N)."""
    motion_error: float
    """Part of the error that the motion causes, without noise (N rms)."""
    amplification: float
    """Force error per sensor noise: the norm of the predictor's weights."""
    weights: FloatArray
    """Weights of the readings, newest first, (memory,)."""

    @property
    def error(self) -> float:
        """Whole error (N rms)."""
        return float(np.hypot(self.motion_error, self.amplification * self.noise))


def linear_limit(
    spectrum: MotionSpectrum,
    setting: AxisSetting,
    *,
    stiffness_factor: float = 1.0,
    noise: float | None = None,
    memory: int = MEMORY,
) -> LinearLimit:
    """The limit on a motion's spectrum; `noise` (N) replaces the setting's sensor noise."""
    level = setting.sensor_noise if noise is None else noise
    ahead = setting.delay + 1
    stiffness = stiffness_factor * setting.stiffness
    r = stiffness**2 * spectrum.autocovariance(memory + ahead)
    column = r[:memory].copy()
    column[0] += level**2
    target = r[ahead : ahead + memory]
    weights = solve_toeplitz(column, target)
    left = r[0] - 2.0 * weights @ target + weights @ matmul_toeplitz(r[:memory], weights)
    return LinearLimit(
        noise=level,
        motion_error=float(np.sqrt(max(left, 0.0))),
        amplification=float(np.linalg.norm(weights)),
        weights=readonly(weights),
    )


def linear_front(
    spectrum: MotionSpectrum, setting: AxisSetting, *, noises: FloatArray
) -> tuple[LinearLimit, ...]:
    """The best exchange of motion error against noise amplification, one point a noise level."""
    return tuple(linear_limit(spectrum, setting, noise=float(noise)) for noise in noises)
