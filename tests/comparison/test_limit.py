from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from mrac_design.comparison.limit import (
    MotionSpectrum,
    linear_front,
    linear_limit,
    motion_spectrum,
)
from mrac_design.errors import ParameterError
from mrac_design.motion import find_model

PERIOD, STIFFNESS = 1e-3, 800.0
LINES = 1 << 15


def resonance():
    """A second-order autoregressive motion: its companion matrix and the drive's deviation."""
    radius, angle = np.exp(-2.0 * PERIOD), 2 * np.pi * 1.5 * PERIOD
    a1, a2 = 2 * radius * np.cos(angle), -(radius**2)
    return np.array([[a1, a2], [1.0, 0.0]]), 3e-8


def resonance_spectrum():
    A, drive = resonance()
    z = np.exp(1j * np.pi * np.arange(LINES + 1) / LINES)
    density = drive**2 / np.abs(1 - A[0, 0] / z - A[0, 1] / z**2) ** 2
    power = density / LINES
    power[[0, -1]] /= 2
    return MotionSpectrum(
        frequency=np.linspace(0.0, 0.5 / PERIOD, LINES + 1), power=power, period=PERIOD
    )


@pytest.fixture(scope="module")
def heart():
    return find_model("heart_invivo_fit").motion(24.0).displacement.selected([2])


@pytest.fixture(scope="module")
def spectrum(heart):
    return motion_spectrum(heart, end=24.0, period=PERIOD)


@pytest.mark.parametrize("delay", [0, 1, 4])
def test_the_limit_is_what_a_kalman_filter_predicts(setting, delay):
    """The Riccati equation knows nothing of Toeplitz matrices."""
    A, drive = resonance()
    C, Q, R = np.array([[STIFFNESS, 0.0]]), np.diag([drive**2, 0.0]), setting.sensor_noise**2
    ahead = solve_discrete_are(A.T, C.T, Q, np.array([[R]]))  # variance one step ahead
    for _ in range(delay):
        ahead = A @ ahead @ A.T + Q
    expected = float(np.sqrt((C @ ahead @ C.T)[0, 0]))
    found = linear_limit(resonance_spectrum(), replace(setting, delay=delay), memory=3000)
    assert found.error == pytest.approx(expected, rel=2e-3)  # 3 s of memory instead of for ever


def test_infinite_memory_gains_little(setting, spectrum):
    """Kolmogorov and Szegő: the innovation's variance is the mean of the spectrum's logarithm."""
    length = 2 * (spectrum.frequency.size - 1)
    density = STIFFNESS**2 * spectrum.power * length / 2 + setting.sensor_noise**2
    cepstrum = np.fft.irfft(np.log(density))
    first = cepstrum[1]  # weight of the innovation before in the innovation form
    variance = np.exp(cepstrum[0]) * (1 + first**2) - setting.sensor_noise**2
    limit = linear_limit(spectrum, setting).error
    assert np.sqrt(variance) <= limit <= 1.1 * np.sqrt(variance)


def test_a_controller_reaches_it(setting, spectrum):
    """The optimal command, computed from past readings alone, in a plain loop."""
    count, memory = 15_000, 200
    limit = linear_limit(spectrum, setting, memory=memory)
    random = np.random.default_rng(1)
    motion = spectrum.realisation(PERIOD * np.arange(count), seed=3)[0]
    caused = -STIFFNESS * motion
    reading = caused + setting.sensor_noise * random.standard_normal(count)
    gain = setting.plant
    A = np.array([[0, 1, 0], [0, -gain.velocity_gain, gain.b0], [0, 0, 0]])
    step = expm(A * PERIOD)
    F, g = step[:2, :2], step[:2, 2]
    x, pending, force = np.zeros(2), 0.0, np.zeros(count)
    for k in range(count):
        force[k] = x[0] + caused[k]
        past = reading[max(0, k - memory + 1) : k + 1][::-1]
        wanted = -limit.weights[: past.size] @ past
        ahead = F @ x + g * pending
        command = (wanted - (F @ ahead)[0]) / g[0]
        x, pending = ahead, command
    rms = np.sqrt(np.mean(force[2000:] ** 2))
    # 13 s hold some tens of independent stretches of the motion.
    assert rms == pytest.approx(limit.error, rel=0.1)


def test_noise_delay_and_stiffness_only_raise_it(setting, spectrum):
    base = linear_limit(spectrum, setting).error
    assert linear_limit(spectrum, setting, noise=2 * setting.sensor_noise).error > base
    assert linear_limit(spectrum, replace(setting, delay=2)).error > base
    assert linear_limit(spectrum, setting, stiffness_factor=1.5).error > base


def test_the_front_exchanges_one_for_the_other(setting, spectrum):
    front = linear_front(spectrum, setting, noises=np.geomspace(5e-4, 0.5, 6))
    assert np.all(np.diff([limit.motion_error for limit in front]) > 0)
    assert np.all(np.diff([limit.amplification for limit in front]) < 0)


def test_the_spectrum_holds_the_windowed_power(heart, spectrum):
    samples = heart(PERIOD * np.arange(24_000))[0]
    window = np.hanning(24_000)
    centred = samples - window @ samples / window.sum()
    expected = (window**2 @ centred**2) / (window**2).sum()
    assert spectrum.autocovariance(1)[0] == pytest.approx(expected, rel=1e-9)


def test_realisations_have_the_spectrum(spectrum):
    t = PERIOD * np.arange(0, 40_000, 10)
    value, rate, _ = spectrum.realisation(t, seed=2)
    # Power over 40 s of a motion of a few lines.
    assert np.mean(value**2) == pytest.approx(spectrum.power.sum(), rel=0.5)
    # The rate is the value's derivative: central differences over 20 ms of motion below 10 Hz.
    assert np.allclose((value[2:] - value[:-2]) / 0.02, rate[1:-1], atol=2e-2 * np.abs(rate).max())


def test_a_short_motion_is_refused(heart):
    with pytest.raises(ParameterError, match="too short"):
        motion_spectrum(heart, end=2.0, period=PERIOD)
