"""Writing a fitted motion model, its quality and its likeness to the recording as TOML."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray
from mrac_design.errors import MotionFileError
from mrac_design.motion.dual_fourier import BeatVariation, DualFourierModel
from mrac_design.motion.fit_quality import BANDS, MotionStatistics, Residual
from mrac_design.motion.heart import AXES
from mrac_design.motion.model_file import read_model
from mrac_design.motion.rhythm import VariableRhythm


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """A fitted model and how well it fits."""

    model: DualFourierModel
    """The model; its coefficients and statistics come from the training frames alone."""
    rhythm: VariableRhythm
    """The model's rhythm."""
    variation: BeatVariation
    """The model's beat-to-beat change of shape."""
    onsets: FloatArray
    """Beats found in the whole recording, s."""
    residuals: tuple[Residual, ...]
    """Residuals on training and held-back frames, the best informed first."""
    recorded: MotionStatistics
    """Statistics of the recording."""
    generated: MotionStatistics
    """Statistics of motions the model generates, mean over several seeds."""


def write_fit(fit: Fit, path: Path) -> None:
    """Write `fit` to `path`, which is replaced at once or, on an error, left as it was.

    Raises MotionFileError when the file cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.toml")
    try:
        temporary.write_text("\n".join(_lines(fit)) + "\n", encoding="utf-8")
        read_model(temporary)
        os.replace(temporary, path)
    except OSError as problem:
        raise MotionFileError(path, "", f"cannot be written: {problem.strerror}") from problem
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _lines(fit: Fit) -> list[str]:
    """The file, line by line."""
    model = fit.model
    lines = [
        "# Heart motion as a Fourier series in a cardiac and a respiratory phase, fitted to a",
        "# recording by `python -m mrac_design.motion.fitting`. Do not edit by hand.",
        "# Times in s, frequencies in Hz, lengths in the unit below.",
        f"name = {_text(model.name)}",
        'origin = "fitted"',
        f"source = {_text(model.source)}",
        "assumptions = [",
        *(f"    {_text(sentence)}," for sentence in model.assumptions),
        "]",
        f"seed = {model.seed}  # of beat lengths and shapes",
        'unit = "mm"',
        "",
        "[rhythm]",
        'kind = "variable"  # normally distributed beat lengths, first-order autoregressive',
        f"mean_period = {_number(fit.rhythm.mean_period)}",
        f"deviation = {_number(fit.rhythm.deviation)}  # standard deviation",
        f"correlation = {_number(fit.rhythm.correlation)}  # of successive beats",
        f"systole = {_number(model.systole)}  # start of a beat that keeps its length",
        "",
        "[breathing]",
        f"frequency = {_number(model.breathing.frequency)}",
        "",
        "[coefficients]",
        "# Rows: 1, cos 2πφ, sin 2πφ, cos 4πφ, … of the cardiac phase; columns: the same of the",
        "# respiratory phase.",
    ]
    for axis, matrix in zip(AXES, model.coefficients, strict=True):
        lines += [f"{axis} = [", *(f"    {_list(row * 1e3, 5)}," for row in matrix), "]"]
    lines += [
        "",
        "[variation]",
        "# Beat-to-beat modes: change of the cardiac coefficients for one standard deviation.",
        f"correlations = {_list(fit.variation.correlations, 4)}  # with the beat before",
    ]
    for mode in fit.variation.modes:
        lines += ["", "[[variation.modes]]"]
        lines += [f"{axis} = {_list(row * 1e3, 5)}" for axis, row in zip(AXES, mode, strict=True)]
    return [*lines, *_quality(fit), *_statistics(fit)]


def _quality(fit: Fit) -> list[str]:
    """Residuals by how much is known of the beat times."""
    lines = [
        "",
        "[quality]",
        f"beats_found = {fit.onsets.size}",
        "# X, Y, Z; explained: 1 − mean square residual / variance, without random variation.",
        "# The numbers of harmonics and modes were chosen by hand with all frames in view; every",
        "# coefficient, period and statistic of the model comes from the training frames.",
    ]
    for residual in fit.residuals:
        lines += [
            "",
            "[[quality.residuals]]",
            f"beat_times = {_text(residual.beat_times)}",
            f"training_rms = {_list(residual.training_rms * 1e3, 3)}",
            f"training_explained = {_list(residual.training_explained, 3)}",
            f"held_back_rms = {_list(residual.held_back_rms * 1e3, 3)}",
            f"held_back_explained = {_list(residual.held_back_explained, 3)}",
        ]
    return lines


def _statistics(fit: Fit) -> list[str]:
    """What the generated motion has in common with the recording."""
    lines = [
        "",
        "[statistics]",
        "# Whole recording (filtered, splined) beside generated motions of its length, mean over",
        "# several seeds. X, Y, Z in mm, mm/s, m/s²; rms displacement by band of frequency.",
        f"bands = {_list(BANDS, 1)}  # Hz, borders",
    ]
    for title, item in (("recorded", fit.recorded), ("generated", fit.generated)):
        lines += [
            "",
            f"[statistics.{title}]",
            f"peak_to_peak = {_list(item.peak_to_peak * 1e3, 2)}",
            f"peak_velocity = {_list(item.peak_velocity * 1e3, 1)}",
            f"rms_velocity = {_list(item.rms_velocity * 1e3, 2)}",
            f"peak_acceleration = {_list(item.peak_acceleration, 3)}",
            f"rms_acceleration = {_list(item.rms_acceleration, 3)}",
            f"band_rms = [{', '.join(_list(row * 1e3, 3) for row in item.band_rms)}]",
        ]
    return lines


def _text(value: str) -> str:
    # A JSON string is a TOML basic string.
    return json.dumps(value, ensure_ascii=False)


def _number(value: float) -> str:
    return f"{value:.6f}"


def _list(values: ArrayLike, decimals: int) -> str:
    # Adding 0.0 turns a rounded −0.0 into 0.0.
    rounded = np.round(np.asarray(values, dtype=np.float64), decimals) + 0.0
    return f"[{', '.join(f'{item:.{decimals}f}' for item in rounded)}]"
