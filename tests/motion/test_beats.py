"""Beats of motions whose beats are known."""

from __future__ import annotations

import numpy as np
import pytest

from mrac_design.motion.beats import find_beats

RATE, FRAMES = 25.0, 750


def regular_motion(period: float, seed: int) -> np.ndarray:
    """Four harmonics of random size and phase on three axes, the same every `period` (s)."""
    random = np.random.default_rng(seed)
    size, phase = random.normal(size=(4, 3)), random.uniform(0, 2 * np.pi, (4, 3))
    t = np.arange(FRAMES)[:, None] / RATE
    order = np.arange(1, 5)
    return sum(
        size[k - 1] / k * np.sin(2 * np.pi * k * t / period + phase[k - 1]) for k in order
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
# Whole numbers of frames, halves, and neither; two and three of the shorter ones fit into 2 s.
@pytest.mark.parametrize("period", [0.5, 0.6, 0.7, 0.93])
def test_one_beat_of_a_perfectly_regular_motion_is_not_two(period, seed):
    beats = find_beats(regular_motion(period, seed), frame_rate=RATE, training=600)
    # The typical interval is a whole number of frames.
    assert beats.typical_interval == pytest.approx(period, abs=0.5 / RATE + 1e-9)
    # Onsets lie on a grid of a tenth of a frame; splines through frames are worst at the ends.
    assert np.diff(beats.onsets)[1:-1] == pytest.approx(period, abs=0.1 / RATE + 1e-9)
    assert abs(beats.onsets.size - FRAMES / RATE / period) < 2


def test_alternating_beats_are_not_taken_for_one_and_its_half():
    """Every other beat half as high: still the same beat, whose shape repeats each time."""
    period = 0.8
    motion = regular_motion(period, seed=3)
    weight = np.where(np.arange(FRAMES) / RATE % (2 * period) < period, 1.0, 0.5)
    beats = find_beats(motion * weight[:, None], frame_rate=RATE, training=600)
    assert beats.typical_interval == period
