"""Figures of merit of force tracking and of effort."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mrac_design.errors import ParameterError
from mrac_design.simulation.trajectory import Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackingMetrics:
    """How well one force axis follows, after the settling time."""

    max_force_error_percent: float
    """max |y − Fd| in percent of the axis's largest |Fd|."""
    max_force_error_N: float
    """max |y − Fd| (N)."""
    rms_force_error_N: float
    """Root mean square of y − Fd (N)."""
    max_model_error_N: float
    """max |y − ym|, distance from the reference model's output (N)."""
    rms_model_error_N: float
    """Root mean square of y − ym (N)."""
    max_desired_force_N: float
    """Largest |Fd| over the whole run (N)."""


def tracking_metrics(trajectory: Trajectory, *, settling: float) -> Mapping[str, TrackingMetrics]:
    """Metrics by force axis over the samples at `settling` s and later.

    Raises ParameterError when nothing is recorded after `settling`.
    """
    kept = trajectory.time >= settling
    if not kept.any():
        raise ParameterError("settling", settling, "nothing is recorded after it")
    force, desired = trajectory["force"], trajectory["desired_force"]
    model_error = (force - trajectory["model_force"])[kept]
    force_error = (force - desired)[kept]
    largest = np.abs(desired).max(axis=0)
    return {
        axis: TrackingMetrics(
            max_force_error_percent=_percent(np.abs(force_error[:, i]).max(), largest[i]),
            max_force_error_N=float(np.abs(force_error[:, i]).max()),
            rms_force_error_N=float(np.sqrt(np.mean(force_error[:, i] ** 2))),
            max_model_error_N=float(np.abs(model_error[:, i]).max()),
            rms_model_error_N=float(np.sqrt(np.mean(model_error[:, i] ** 2))),
            max_desired_force_N=float(largest[i]),
        )
        for i, axis in enumerate(trajectory.signals["force"].labels)
    }


def max_torque(trajectory: Trajectory) -> Mapping[str, float]:
    """Largest |torque| of each motor over the whole run (N·m), by motor."""
    signal = trajectory.signals["torque"]
    peaks = np.abs(signal.values).max(axis=0)
    return {motor: float(peak) for motor, peak in zip(signal.labels, peaks, strict=True)}


def _percent(part: float, whole: float) -> float:
    """Infinite when there is no desired force to compare with."""
    return float(100 * part / whole) if whole > 0 else float("inf")
