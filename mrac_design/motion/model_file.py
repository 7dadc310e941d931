"""Dual Fourier models as TOML files: strict reading, and which ones ship with the package.

A file holds either a table of amplitudes and phases, or fitted coefficients with beat-to-beat
variation, or refers to another packaged model (`based_on`) and gives it another rhythm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.errors import MotionFileError
from mrac_design.motion.dual_fourier import BeatVariation, Breathing, DualFourierModel
from mrac_design.motion.heart import AXES, Origin
from mrac_design.motion.rhythm import (
    JitteredRhythm,
    RegularRhythm,
    Rhythm,
    VariableRhythm,
    WithEctopicBeat,
)
from mrac_design.motion.track_file import METRES
from mrac_design.resources import models_directory
from mrac_design.strict_toml import Table, read_table, shown

_COMMON = ("name", "origin", "source", "assumptions", "seed", "unit", "rhythm", "breathing")
_FITTED = ("coefficients", "variation", "quality", "statistics")


def available_motions() -> tuple[str, ...]:
    """Names of the packaged motion models, sorted."""
    return tuple(sorted(path.stem for path in (models_directory() / "motions").glob("*.toml")))


def names_model(source: str) -> bool:
    """Whether a source of motion is a packaged model or a model file; else it is a recording."""
    return source in available_motions() or Path(source).suffix == ".toml"


def find_model(name_or_path: Path | str) -> DualFourierModel:
    """A packaged model by name, or the one in a TOML file.

    Raises MotionFileError naming the packaged models when there is neither.
    """
    if str(name_or_path) in available_motions():
        return read_model(models_directory() / "motions" / f"{name_or_path}.toml")
    path = Path(name_or_path)
    if path.suffix.lower() != ".toml" or not path.is_file():
        raise MotionFileError(
            path,
            "",
            "is neither a motion model file (.toml) nor a packaged motion "
            f"({', '.join(available_motions())})",
        )
    return read_model(path)


def read_model(path: Path) -> DualFourierModel:
    """Read one model file; raises MotionFileError naming the key that is wrong."""
    root = read_table(path, MotionFileError)
    if "based_on" in root.entries:
        return _variant(root)
    content = ("amplitudes",) if "amplitudes" in root.entries else _FITTED
    root.only(*_COMMON, *content)
    metres = root.choice("unit", METRES)
    seed = _whole(root, "seed")
    rhythm, systole = _rhythm(root.table("rhythm"))
    if "amplitudes" in root.entries:
        coefficients, variation = _amplitudes(root.table("amplitudes")) * metres, None
    else:
        coefficients = np.stack(
            [_matrix(root.table("coefficients"), axis) * metres for axis in AXES]
        )
        variation = _variation(root.table("variation"), metres)
    origins = {origin.name.lower(): origin for origin in (Origin.FITTED, Origin.ASSUMED)}
    return root.build(
        lambda: DualFourierModel(
            name=root.text("name"),
            origin=root.choice("origin", origins),
            source=root.text("source"),
            assumptions=_sentences(root),
            coefficients=coefficients,
            rhythm=rhythm,
            systole=systole,
            breathing=_breathing(root.table("breathing")),
            variation=variation,
            seed=seed,
        )
    )


def _variant(root: Table) -> DualFourierModel:
    """Another packaged model under another rhythm and breathing."""
    root.only("name", "based_on", "assumptions", "rhythm", "breathing")
    base = root.text("based_on")
    if base not in available_motions() or base == root.path.stem:
        raise root.error(
            "based_on",
            f'"{base}" is not another packaged motion ({", ".join(available_motions())})',
        )
    model = read_model(models_directory() / "motions" / f"{base}.toml")
    rhythm, systole = _rhythm(root.table("rhythm"))
    return root.build(
        lambda: replace(
            model,
            name=root.text("name"),
            assumptions=(*model.assumptions, *_sentences(root)),
            rhythm=rhythm,
            systole=systole,
            breathing=_breathing(root.table("breathing")),
        )
    )


def _rhythm(table: Table) -> tuple[Rhythm, float]:
    """The rhythm and the length of systole, s."""
    keys = {
        "regular": (),
        "jittered": ("jitter",),
        "variable": ("deviation", "correlation"),
        "ectopic": ("beat", "prematurity"),
    }
    if "kind" not in table.entries:
        raise table.error("kind", f"is missing; one of {', '.join(keys)}")
    extra = table.choice("kind", keys)
    table.only("kind", "mean_period", "systole", *extra)
    period = table.number("mean_period")
    numbers = {key: table.number(key) for key in extra}
    builders: dict[str, Callable[[], Rhythm]] = {
        "regular": lambda: RegularRhythm(mean_period=period),
        "jittered": lambda: JitteredRhythm(mean_period=period, jitter=numbers["jitter"]),
        "variable": lambda: VariableRhythm(
            mean_period=period,
            deviation=numbers["deviation"],
            correlation=numbers["correlation"],
        ),
        "ectopic": lambda: WithEctopicBeat(
            rhythm=RegularRhythm(mean_period=period),
            beat=_whole(table, "beat"),
            prematurity=numbers["prematurity"],
        ),
    }
    return table.build(builders[table.text("kind")]), table.number("systole")


def _breathing(table: Table) -> Breathing:
    """Respiratory rate, and when it is held if it is."""
    if "stop" in table.entries or "fade" in table.entries:
        table.only("frequency", "stop", "fade")
        return table.build(
            lambda: Breathing(
                frequency=table.number("frequency"),
                stop=table.number("stop"),
                fade=table.number("fade"),
            )
        )
    table.only("frequency")
    return table.build(lambda: Breathing(frequency=table.number("frequency")))


def _amplitudes(table: Table) -> FloatArray:
    """C (3, 2n + 1, 2k + 1) from Σ A cos(2πjφ + phase) for the beat and for the breath."""
    table.only(*AXES)
    series = []
    for axis in AXES:
        part = table.table(axis)
        part.only("cardiac", "cardiac_phase", "respiratory", "respiratory_phase")
        pair = []
        for name in ("cardiac", "respiratory"):
            size = np.array(part.numbers(name))
            angle = np.array(part.numbers(f"{name}_phase", size.size))
            # A cos(α + ψ) = A cos ψ · cos α − A sin ψ · sin α
            pair.append(np.stack((size * np.cos(angle), -size * np.sin(angle)), axis=1).ravel())
        series.append(pair)
    counts = {(cardiac.size, respiratory.size) for cardiac, respiratory in series}
    if len(counts) > 1:
        raise table.error("", "the axes need equally many amplitudes (fill up with 0.0)")
    rows, columns = counts.pop()
    coefficients = np.zeros((len(AXES), rows + 1, columns + 1))
    for index, (cardiac, respiratory) in enumerate(series):
        coefficients[index, 1:, 0] = cardiac
        coefficients[index, 0, 1:] = respiratory
    return coefficients


def _variation(table: Table, metres: float) -> BeatVariation:
    """Modes of the beat-to-beat change of shape."""
    table.only("correlations", "modes")
    modes = []
    for mode in table.tables("modes"):
        mode.only(*AXES)
        modes.append([mode.numbers(axis) for axis in AXES])
    if len({len(row) for mode in modes for row in mode}) > 1:
        raise table.error("modes", "all need equally many coefficients")
    correlations = np.array(table.numbers("correlations", len(modes)))
    return table.build(
        lambda: BeatVariation(modes=np.array(modes) * metres, correlations=correlations)
    )


def _matrix(table: Table, axis: str) -> FloatArray:
    """A list of equally long rows of numbers."""
    table.only(*AXES)
    rows = table.entries[axis]
    if not isinstance(rows, list) or not all(isinstance(row, list) for row in rows):
        raise table.error(axis, f"needs a list of rows of numbers, got {shown(rows)}")
    lines = [
        Table(
            path=table.path,
            place=f"{table.place}.{axis}",
            entries={f"row {index}": row},
            error_type=table.error_type,
        ).numbers(f"row {index}", len(rows[0]))
        for index, row in enumerate(rows, 1)
    ]
    return np.array(lines)


def _whole(table: Table, key: str) -> int:
    """A whole number."""
    value = table.number(key)
    if value != int(value):
        raise table.error(key, f"needs a whole number, got {value:g}")
    return int(value)


def _sentences(table: Table) -> tuple[str, ...]:
    """The list of assumptions."""
    value = table.entries["assumptions"]
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise table.error("assumptions", f"needs a list of sentences, got {shown(value)}")
    return tuple(value)
