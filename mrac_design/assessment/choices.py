"""What a stability report covers, read from a file: boxes, sampling, map, hostile runs, needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from flint import fmpq

from mrac_design.assessment.advisor import Requirements
from mrac_design.errors import ParameterError, ScenarioFileError
from mrac_design.polynomials.rationals import decimal_rational
from mrac_design.resources import models_directory
from mrac_design.stability import Sampling, sampling
from mrac_design.strict_toml import Table, read_table

_Section = TypeVar("_Section")


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledChoice:
    """The design for a processor."""

    bandwidth: float
    """ω = ao (rad/s)."""
    rate: float
    """Sampling rate (Hz)."""
    delay: int
    """Computational delay (whole samples)."""
    box: float
    """Share by which the gains may leave nominal."""

    @property
    def timing(self) -> Sampling:
        """Period and delay."""
        return sampling(1 / decimal_rational(self.rate), self.delay)


@dataclass(frozen=True, slots=True, kw_only=True)
class MapChoice:
    """Rows and columns of the design map."""

    bandwidths: tuple[float, ...]
    """ω of every row (rad/s)."""
    rates: tuple[float, ...]
    """Sampling rate of every column (Hz)."""
    delays: tuple[int, ...]
    """Delay of every column (whole samples)."""
    resolution: float
    """Width of the bisection's last step."""

    def __post_init__(self) -> None:
        if len(self.rates) != len(self.delays):
            raise ParameterError("delays", len(self.delays), f"needs {len(self.rates)}, like rates")

    @property
    def samplings(self) -> tuple[Sampling, ...]:
        """Timing of every column."""
        pairs = zip(self.rates, self.delays, strict=True)
        return tuple(sampling(1 / decimal_rational(rate), delay) for rate, delay in pairs)


@dataclass(frozen=True, slots=True, kw_only=True)
class MismatchChoice:
    """Where the inertia mismatch is checked, and for which boxes its tolerance is proved."""

    boxes: tuple[float, ...]
    """Shares by which the gains may leave nominal."""
    near_slide: float
    """Prismatic joints around home: ± (m)."""
    near_turn: float
    """Revolute joints around home: ± (rad)."""
    far_slide: float
    """Prismatic joints across the workspace: ± (m)."""
    far_turn: float
    """Revolute joints across the workspace: ± (rad)."""
    points: int
    """Grid points a joint."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HostileChoice:
    """How hard simulation tries to exceed the bounds."""

    paths: int
    """Paths of gains, half random and half adversarial."""
    spans: int
    """Spans of constant gains in a path."""
    runs: int
    """Runs of the adaptive law itself."""
    gains: tuple[float, ...]
    """γ̂ of those runs, in turn."""
    seed: int
    """Seed of all randomness."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityChoices:
    """Everything a stability report depends on beside the scenario."""

    name: str
    """Short name."""
    softest: float
    """Least tissue stiffness covered (N/m)."""
    stiffest: float
    """Greatest tissue stiffness covered (N/m)."""
    continuous_box: float
    """Share by which the gains of the continuous design may leave nominal."""
    sampled: SampledChoice
    """The design for a processor."""
    map: MapChoice
    """The design map."""
    mismatch: MismatchChoice
    """Inertia mismatch."""
    hostile: HostileChoice
    """Hostile simulation."""
    needs: Requirements
    """What the adaptation gain has to respect."""
    window: float
    """Length of a window of persistent excitation (s)."""

    @property
    def tissue(self) -> tuple[fmpq, fmpq]:
        """Stiffness range (N/m), exactly as written."""
        return decimal_rational(self.softest), decimal_rational(self.stiffest)


def available_choices() -> tuple[str, ...]:
    """Names of the choices that come with the package, sorted."""
    return tuple(sorted(path.stem for path in (models_directory() / "stability").glob("*.toml")))


def choices_path(name_or_path: str | Path) -> Path:
    """The file behind a packaged name or a path; raises ScenarioFileError when there is none."""
    path = Path(name_or_path)
    if isinstance(name_or_path, str) and name_or_path in available_choices():
        return models_directory() / "stability" / f"{name_or_path}.toml"
    if not path.is_file():
        names = ", ".join(available_choices())
        raise ScenarioFileError(path, "", f"no such file, nor one of the choices {names}")
    return path


def load_choices(name_or_path: str | Path) -> StabilityChoices:
    """Choices of a packaged name or of a TOML file's path.

    Raises ScenarioFileError, naming file and key, for anything missing, misspelt or out of range.
    """
    root = read_table(choices_path(name_or_path), ScenarioFileError)
    root.only(
        "name", "tissue", "continuous", "sampled", "map", "mismatch", "hostile", "advice",
        "excitation",
    )  # fmt: skip
    tissue, continuous, excitation = (
        root.table(name) for name in ("tissue", "continuous", "excitation")
    )
    tissue.only("softest", "stiffest")
    continuous.only("box")
    excitation.only("window")
    return root.build(
        lambda: StabilityChoices(
            name=root.text("name"),
            softest=tissue.number("softest"),
            stiffest=tissue.number("stiffest"),
            continuous_box=continuous.number("box"),
            sampled=_section(root.table("sampled"), SampledChoice, whole=("delay",)),
            map=_section(root.table("map"), MapChoice, whole=("delays",)),
            mismatch=_section(root.table("mismatch"), MismatchChoice, whole=("points",)),
            hostile=_section(
                root.table("hostile"), HostileChoice, whole=("paths", "spans", "runs", "seed")
            ),
            needs=_section(root.table("advice"), Requirements),
            window=excitation.number("window"),
        )
    )


def _section(
    table: Table, kind: Callable[..., _Section], *, whole: tuple[str, ...] = ()
) -> _Section:
    """A dataclass of numbers and lists of numbers; fields in `whole` are whole numbers."""
    names = tuple(kind.__dataclass_fields__)  # type: ignore[attr-defined]
    table.only(*names)
    return table.build(lambda: kind(**{n: _entry(table, n, n in whole) for n in names}))


def _entry(table: Table, key: str, whole: bool) -> float | int | tuple[float | int, ...]:
    if isinstance(table.entries[key], list):
        return tuple(_whole(table, key, v) if whole else v for v in table.numbers(key))
    return _whole(table, key, table.number(key)) if whole else table.number(key)


def _whole(table: Table, key: str, value: float) -> int:
    if value != int(value):
        raise table.error(key, f"needs whole numbers, got {value:g}")
    return int(value)
