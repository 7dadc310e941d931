"""Heart motion from a recorded track of camera frames, CSV or MATLAB.

SciPy is imported where it is used: loading its filters takes longer than a study of a recording
to run. What they made of a recording is kept for later processes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.derivation_cache import derived_text, scipy_release
from mrac_design.errors import MotionFileError, ParameterError
from mrac_design.motion.heart import HeartMotion, Origin, centred_motion
from mrac_design.motion.model_file import available_motions
from mrac_design.motion.signal import PiecewisePolynomial, from_ppoly
from mrac_design.motion.track_file import read_track

FILTER_ORDER = 4
"""Order of the Butterworth low-pass, run forwards and then backwards over a track."""


def read_recorded_motion(
    path: Path | str,
    *,
    point: str = "p4",
    frame_rate: float,
    cutoff: float = 8.0,
    duration: float | None = None,
    start_frame: int = 0,
    unit: str | None = None,
) -> HeartMotion:
    """Read one tracked point as a heart motion: low-pass, mean off, cubic spline.

    `point` names the columns `<point>_x_<unit>`, `_y_`, `_z_`; `unit` (m, cm, mm, um) is
    needed only where the names carry none. `frame_rate` and `cutoff` in Hz. The motion starts
    `start_frame` frames after the first and lasts `duration` s, or to the end of the track.

    Raises MotionFileError for a file that cannot be used and ParameterError for a cut-off
    outside 0 … frame_rate / 2.
    """
    file = Path(path)
    if not file.suffix and not file.exists():
        raise MotionFileError(
            file, "", f"no such file, nor a packaged motion ({', '.join(available_motions())})"
        )
    if not (np.isfinite(frame_rate) and frame_rate > 0.0):
        raise MotionFileError(
            file, "frame rate", f"{frame_rate} Hz: must be a positive number of frames a second"
        )
    track = read_track(file, point=point, unit=unit)
    spline = _kept_spline(file, track.position, frame_rate, cutoff, start_frame)
    return centred_motion(
        name=f"{file.stem} {point}",
        origin=Origin.RECORDED,
        source=f"{file.name}, point {point}, from frame {start_frame}",
        assumptions=(
            f"The frame rate is taken as {frame_rate:g} Hz.",
            "Camera axes x, y, z are taken as the robot's X, Y, Z.",
            f"Zero-phase Butterworth low-pass of order {FILTER_ORDER}, run forwards and "
            f"backwards, cut-off {cutoff:g} Hz.",
            f"Between frames a cubic spline: nothing above {frame_rate / 2:g} Hz was recorded.",
        ),
        displacement=_beginning(file, spline, frame_rate, duration),
    )


def _kept_spline(
    path: Path, position: FloatArray, frame_rate: float, cutoff: float, start: int
) -> PiecewisePolynomial:
    """Cubic spline through the low-passed frames from `start` on."""

    def derive() -> str:
        filtered = low_pass(position, frame_rate=frame_rate, cutoff=cutoff, path=path)
        spline = _spline(path, filtered, frame_rate, start)
        return f"{spline.breakpoints.tobytes().hex()} {spline.coefficients.tobytes().hex()}"

    content = repr((frame_rate, cutoff, start)).encode() + position.tobytes()
    words = derived_text(("motion",), scipy_release(), content, derive).split()
    breakpoints, coefficients = (np.frombuffer(bytes.fromhex(word)) for word in words)
    return PiecewisePolynomial(
        breakpoints=breakpoints,
        coefficients=coefficients.reshape(position.shape[1], breakpoints.size - 1, -1),
    )


def _spline(path: Path, position: FloatArray, frame_rate: float, start: int) -> PiecewisePolynomial:
    """Cubic spline through the frames from `start` on."""
    from scipy.interpolate import CubicSpline

    frames = position.shape[0]
    if not 0 <= start < frames - 1:
        raise MotionFileError(
            path, "start frame", f"{start}: must be one of 0 … {frames - 2} of {frames} frames"
        )
    used = position[start:]
    return from_ppoly(CubicSpline(np.arange(used.shape[0]) / frame_rate, used))


def _beginning(
    path: Path, spline: PiecewisePolynomial, frame_rate: float, duration: float | None
) -> PiecewisePolynomial:
    """As much of the motion as is asked for."""
    available = spline.end
    length = available if duration is None else duration
    if not (np.isfinite(length) and length > 0.0):
        raise ParameterError("duration", length, "must be a positive time in s")
    if length > available * (1.0 + 1e-12):
        raise MotionFileError(
            path,
            f"{spline.segments + 1} frames",
            f"last {available:.6g} s at {frame_rate:g} Hz, but {length:.6g} s are asked for: "
            "shorten the duration or take a longer recording",
        )
    return spline if length >= available else spline.restricted(0.0, length)


def low_pass(position: FloatArray, *, frame_rate: float, cutoff: float, path: Path) -> FloatArray:
    """Zero-phase low-pass of a track (frames, 3); rates in Hz; `path` is named in errors.

    Raises ParameterError for a cut-off outside 0 … frame_rate / 2 and MotionFileError for a
    track shorter than the filter needs.
    """
    nyquist = 0.5 * frame_rate
    if not 0.0 < cutoff < nyquist:
        raise ParameterError(
            "cutoff",
            f"{cutoff:g} Hz",
            f"must lie between 0 and {nyquist:g} Hz, half the frame rate of {frame_rate:g} Hz",
        )
    padding = 3 * (FILTER_ORDER + 1)
    if position.shape[0] <= padding:
        raise MotionFileError(
            path,
            f"{position.shape[0]} frames",
            f"too short: the low-pass filter needs more than {padding}",
        )
    from scipy.signal import butter, filtfilt

    b, a = butter(FILTER_ORDER, cutoff / nyquist)
    filtered: FloatArray = filtfilt(b, a, position, axis=0, padlen=padding)
    return filtered
