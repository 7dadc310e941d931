"""The low-pass and the spline of recorded frames against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, filtfilt

from mrac_design.motion.frames import cubic_spline, zero_phase_butterworth


def wander(frames: int) -> np.ndarray:
    """Three axes that drift like a random walk, (frames, 3)."""
    return np.cumsum(np.random.default_rng(1).normal(size=(frames, 3)), axis=0)


@pytest.mark.parametrize("order", [1, 3, 4])
@pytest.mark.parametrize("share", [0.1, 0.64, 0.9])
def test_the_low_pass_is_filtfilt(order, share):
    position, padding = wander(200), 3 * (order + 1)
    expected = filtfilt(*butter(order, share), position, axis=0, padlen=padding)
    found = zero_phase_butterworth(position, order=order, share=share, padding=padding)
    # Poles near -1 or 1 (share 0.1, 0.9) lose three digits to the polynomial's coefficients.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(position).max())


@pytest.mark.parametrize("frames", [2, 3, 4, 5, 60])
def test_the_spline_is_scipys(frames):
    values, rate = wander(frames), 25.0
    spline = cubic_spline(values, frame_rate=rate)
    times = np.linspace(0.0, (frames - 1) / rate, 501)
    expected = CubicSpline(np.arange(frames) / rate, values)(times).T
    np.testing.assert_allclose(spline(times), expected, rtol=0, atol=1e-13 * np.abs(values).max())
