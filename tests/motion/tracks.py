"""Synthetic camera tracks for the reader's tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def slow_track(frames: int, rate: float) -> np.ndarray:
    """Three sums of sines under 3 Hz about a mean, mm, (frames, 3)."""
    t = np.arange(frames) / rate
    return np.stack(
        (
            5.0 + 1.5 * np.sin(2 * np.pi * 0.8 * t),
            -2.0 + 0.7 * np.cos(2 * np.pi * 1.6 * t) + 0.4 * np.sin(2 * np.pi * 0.2 * t),
            40.0 + 1.0 * np.sin(2 * np.pi * 2.4 * t + 0.3),
        ),
        axis=1,
    )


def write_csv(path: Path, position: np.ndarray, point: str = "p4", unit: str = "mm") -> Path:
    """A track as CSV with frame numbers from 0; returns the path."""
    suffix = f"_{unit}" if unit else ""
    lines = ["frame," + ",".join(f"{point}_{axis}{suffix}" for axis in "xyz")]
    lines += [f"{n},{x!r},{y!r},{z!r}" for n, (x, y, z) in enumerate(position.tolist())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
