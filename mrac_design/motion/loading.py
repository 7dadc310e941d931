"""Heart motions by name, and the two packaged families by function."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mrac_design.motion.dual_fourier import Breathing
from mrac_design.motion.heart import HeartMotion
from mrac_design.motion.model_file import find_model
from mrac_design.motion.rhythm import Rhythm


def load_motion(
    name_or_path: Path | str, *, duration: float, seed: int | None = None
) -> HeartMotion:
    """The motion of a packaged model (see `available_motions`) or of a TOML model file.

    `duration` in s; `seed` replaces the file's seed of the beat-to-beat variation. Recorded
    tracks are read by `read_recorded_motion`, which must be told a frame rate. Raises
    MotionFileError for a file that cannot be used.
    """
    model = find_model(name_or_path)
    return (model if seed is None else model.with_seed(seed)).motion(duration)


def fitted_motion(name: str, duration: float, *, seed: int | None = None) -> HeartMotion:
    """A motion generated from a model fitted to a recording, `duration` s; as `load_motion`."""
    return load_motion(name, duration=duration, seed=seed)


def parametric_motion(
    duration: float,
    *,
    rhythm: Rhythm | None = None,
    breathing: Breathing | None = None,
    seed: int | None = None,
) -> HeartMotion:
    """The assumed motion: five cardiac and two respiratory harmonics on each axis.

    `rhythm` and `breathing` replace the regular 1.25 Hz and 0.25 Hz of the packaged model
    "parametric"; beats of other lengths are stretched as a whole.
    """
    model = find_model("parametric")
    return replace(
        model,
        rhythm=model.rhythm if rhythm is None else rhythm,
        breathing=model.breathing if breathing is None else breathing,
        seed=model.seed if seed is None else seed,
    ).motion(duration)
