"""A scenario: every choice of one study, read from a file or made by hand."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from mrac_design.controller.adaptation import AdaptationLaw, GradientLaw, NormalisedGradientLaw
from mrac_design.controller.linearisation import RobotModelError
from mrac_design.design import ReferenceModel, RSTSpecification, first_order_observer
from mrac_design.errors import ParameterError, ScenarioFileError
from mrac_design.motion import ForceReference
from mrac_design.plant import ForcePlant
from mrac_design.resources import models_directory
from mrac_design.simulation.plant_choices import (
    CONTACT_KEYS,
    ContactChoice,
    FrictionChoice,
    contact_entries,
    read_contact,
    read_steps,
    step_entries,
)
from mrac_design.simulation.safeguards import (
    Safeguard,
    read_safeguards,
    safeguard_entries,
    wrapped,
)
from mrac_design.simulation.sampling_choices import Sampling, read_sampling, sampling_entries
from mrac_design.strict_toml import Table, read_table

_Section = TypeVar("_Section")


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionChoice:
    """Which heart motion drives the study."""

    source: str
    """Name of a packaged motion, or path of a recording."""
    frame_rate: float
    """Frames a second (Hz) of a recording; assumed where the recording does not state it."""
    point: str
    """Tracked point of a recording."""
    cutoff: float
    """Cutoff of the zero-phase low-pass on a recording (Hz)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignChoice:
    """The controller's design parameters."""

    stiffness: float
    """Ks the controller is made for (N/m)."""
    velocity_gain: float
    """K2 of the velocity loop (1/s)."""
    bandwidth: float
    """ω of the reference model (rad/s)."""
    damping: float
    """ξ of the reference model."""
    observer: tuple[float, ...]
    """Observer polynomial Ao, highest power first, monic; (1, ao) is the paper's p + ao. In a file
    `observer_pole` ao or `observer`."""
    internal_model: tuple[float, ...]
    """Factor D of R, highest power first, monic; (1,) is none. May be left out of a file with
    `observer_pole`."""
    tool_axis_bandwidth: float
    """Bandwidth of the PD control of the tool axis (rad/s)."""

    def __post_init__(self) -> None:
        self.specification  # noqa: B018  (raises what no design can have)

    @property
    def specification(self) -> RSTSpecification:
        """What the RST design is made from."""
        return RSTSpecification(
            plant=ForcePlant(stiffness=self.stiffness, velocity_gain=self.velocity_gain),
            reference_model=ReferenceModel(bandwidth=self.bandwidth, damping=self.damping),
            observer=self.observer,
            internal_model=self.internal_model,
        )

    @property
    def observer_pole(self) -> float:
        """ao of Ao = p + ao (rad/s). Raises ParameterError for an observer of higher degree."""
        return self.specification.observer_pole

    def with_observer_pole(self, pole: float) -> DesignChoice:
        """The same with Ao = p + `pole`. Raises ParameterError where an internal model needs an
        observer of higher degree."""
        if len(self.internal_model) != 1:
            raise ParameterError(
                "observer pole", pole, "this design has an internal model: give its whole observer"
            )
        return replace(self, observer=first_order_observer(pole))

    @property
    def gain_count(self) -> int:
        """Number of gains that adapt, without the bias."""
        return len(self.specification.gain_names)


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptationChoice:
    """The adaptation law and its gains."""

    law: str
    """"normalised" or "gradient"."""
    gain: float
    """Scaled gain γ̂."""
    normalisation: float
    """α of the normalised law (N²)."""
    bias_force: float
    """Size of the constant regressor (N); 0 leaves it out."""
    safeguards: tuple[Safeguard, ...]
    """Wrappers of the law, the first one innermost."""

    def build(self, gain: float, *, nominal: tuple[float, ...]) -> AdaptationLaw:
        """The law inside its safeguards, with `gain` in place of its own (0 when frozen).

        `nominal` are the design's scaled gains, which safeguards refer to.
        """
        return wrapped(LAWS[self.law](gain, self.normalisation), self.safeguards, nominal)


LAWS: Mapping[str, Callable[[float, float], AdaptationLaw]] = {
    "normalised": lambda gain, alpha: NormalisedGradientLaw(gain=gain, alpha=alpha),
    "gradient": lambda gain, _: GradientLaw(gain=gain),
}
"""Adaptation laws a scenario can name, made from (γ̂, α)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationChoice:
    """How the study is run and judged."""

    duration: float
    """Length of the run (s)."""
    step: float
    """Largest integration step (s)."""
    record_period: float
    """Time between recorded samples (s)."""
    settling: float
    """Time at the start left out of the figures of merit (s)."""
    condition_limit: float
    """Largest condition number of the task Jacobian that is accepted."""

    def __post_init__(self) -> None:
        for name in ("duration", "step", "record_period", "condition_limit"):
            value = getattr(self, name)
            if not 0 < value < float("inf"):
                raise ParameterError(name, value, "must be a finite number > 0")
        if not 0 <= self.settling < self.duration:
            raise ParameterError(
                "settling", self.settling, f"must lie in [0, duration = {self.duration:g} s)"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """Everything a study depends on."""

    name: str
    """Short name."""
    title: str
    """Title of the report."""
    robot: str
    """Name of a packaged robot, or path of a robot file."""
    motion: MotionChoice
    """Heart motion."""
    stiffness: float
    """True Ks of the tissue (N/m)."""
    contact: ContactChoice
    """What the tissue does beside being a spring."""
    friction: FrictionChoice
    """Friction of the true robot's joints."""
    sampling: Sampling
    """The controller's time domain, and how it measures when it is sampled."""
    design: DesignChoice
    """Controller design."""
    prefilter: ReferenceModel
    """Pre-filter Hm of the force reference."""
    adaptation: AdaptationChoice
    """Adaptation."""
    model_error: RobotModelError
    """Error of the controller's robot model."""
    reference: ForceReference
    """Force reference before the pre-filter, axis by axis."""
    simulation: SimulationChoice
    """Run settings."""

    def __post_init__(self) -> None:
        if not 0 < self.stiffness < float("inf"):
            raise ParameterError("stiffness", self.stiffness, "must be finite and > 0 N/m")


def available_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come with the package, sorted."""
    return tuple(sorted(path.stem for path in (models_directory() / "scenarios").glob("*.toml")))


def load_scenario(name_or_path: str | Path) -> Scenario:
    """Scenario of a packaged name or of a TOML file's path.

    Relative paths inside the file count from the file's own folder. Raises ScenarioFileError,
    naming file and key, for anything missing, misspelt or outside its range.
    """
    path = Path(name_or_path)
    if isinstance(name_or_path, str) and name_or_path in available_scenarios():
        path = models_directory() / "scenarios" / f"{name_or_path}.toml"
    elif not path.exists():
        names = ", ".join(available_scenarios())
        raise ScenarioFileError(
            path, "", f"no such scenario file, nor one of the scenarios {names}"
        )
    root = read_table(path, ScenarioFileError)
    root.only(
        "name", "title", "robot", "motion", "contact", "friction", "sampling", "design",
        "prefilter", "adaptation", "model_error", "reference", "simulation",
    )  # fmt: skip
    contact = root.table("contact")
    contact.only(*CONTACT_KEYS)
    return root.build(
        lambda: Scenario(
            name=root.text("name"),
            title=root.text("title"),
            robot=_beside(path, root.text("robot")),
            motion=_motion(root.table("motion")),
            stiffness=contact.number("stiffness"),
            contact=read_contact(contact),
            friction=_section(root.table("friction"), FrictionChoice),
            sampling=read_sampling(root.table("sampling")),
            design=(design := _design(root.table("design"))),
            prefilter=_section(root.table("prefilter"), ReferenceModel),
            adaptation=_adaptation(root.table("adaptation"), design.gain_count),
            model_error=_section(root.table("model_error"), RobotModelError),
            reference=_reference(root.table("reference")),
            simulation=_section(root.table("simulation"), SimulationChoice),
        )
    )


def save_scenario(scenario: Scenario, path: Path, *, remarks: Sequence[str] = ()) -> None:
    """Write a scenario file that `load_scenario` reads back to an equal scenario.

    `remarks` are lines of comment at its top. The file appears whole or not at all.
    """
    content = {
        "name": scenario.name,
        "title": scenario.title,
        "robot": scenario.robot,
        "motion": _entries(scenario.motion),
        "contact": contact_entries(scenario.stiffness, scenario.contact),
        "friction": _entries(scenario.friction),
        "sampling": sampling_entries(scenario.sampling),
        "design": _design_entries(scenario.design),
        "prefilter": _entries(scenario.prefilter),
        "adaptation": {
            **_entries(scenario.adaptation),
            "safeguards": safeguard_entries(scenario.adaptation.safeguards),
        },
        "model_error": _entries(scenario.model_error),
        "reference": {
            axis: step_entries(steps)
            for axis, steps in zip("XYZ", scenario.reference.steps, strict=False)
        },
        "simulation": _entries(scenario.simulation),
    }
    temporary = path.with_suffix(".toml.part")
    comment = "".join(f"# {line}\n" for line in remarks)
    import tomli_w  # for writing only

    temporary.write_text(comment + tomli_w.dumps(content), encoding="utf-8")
    os.replace(temporary, path)


def _entries(section: object) -> dict[str, Any]:
    return {name: getattr(section, name) for name in section.__dataclass_fields__}  # type: ignore[attr-defined]


def _section(table: Table, kind: type[_Section]) -> _Section:
    names = tuple(kind.__dataclass_fields__)  # type: ignore[attr-defined]
    table.only(*names)
    return table.build(lambda: kind(**{name: table.number(name) for name in names}))


def _motion(table: Table) -> MotionChoice:
    table.only("source", "frame_rate", "point", "cutoff")
    return MotionChoice(
        source=_beside(table.path, table.text("source")),
        frame_rate=table.number("frame_rate"),
        point=table.text("point"),
        cutoff=table.number("cutoff"),
    )


_PAPER_KEYS = ("stiffness", "velocity_gain", "bandwidth", "damping", "tool_axis_bandwidth")


def _design(table: Table) -> DesignChoice:
    """The design, with the paper's observer pole or with an observer and an internal model."""
    whole = [key for key in ("observer", "internal_model") if key in table.entries]
    if whole and "observer_pole" in table.entries:
        raise table.error(
            whole[0], "stands beside observer_pole; keep the pole, or observer and internal_model"
        )
    table.only(*_PAPER_KEYS, *(("observer", "internal_model") if whole else ("observer_pole",)))
    if whole:
        observer = tuple(table.numbers("observer"))
        internal_model = tuple(table.numbers("internal_model"))
    else:
        observer, internal_model = first_order_observer(table.number("observer_pole")), (1.0,)
    numbers = {name: table.number(name) for name in _PAPER_KEYS}
    try:
        return DesignChoice(**numbers, observer=observer, internal_model=internal_model)
    except ParameterError as error:
        key = _key_of(error.name, table)
        raise table.error(key, f"{error.value}: {error.requirement}") from error


def _key_of(name: str, table: Table) -> str:
    """The key behind a parameter's name: "internal model" is internal_model, and an "observer"
    that is not there has come from observer_pole."""
    words = name.replace(" ", "_")
    return next((k for k in table.entries if words.startswith(k) or k.startswith(words)), name)


def _design_entries(design: DesignChoice) -> dict[str, Any]:
    entries = {name: getattr(design, name) for name in _PAPER_KEYS}
    if design.internal_model == (1.0,) and len(design.observer) == 2:
        return {**entries, "observer_pole": design.observer[1]}
    return {
        **entries,
        "observer": list(design.observer),
        "internal_model": list(design.internal_model),
    }


def _adaptation(table: Table, gain_count: int) -> AdaptationChoice:
    table.only("law", "gain", "normalisation", "bias_force", "safeguards")
    table.choice("law", LAWS)
    choice = AdaptationChoice(
        law=table.text("law"),
        gain=table.number("gain"),
        normalisation=table.number("normalisation"),
        bias_force=table.number("bias_force"),
        safeguards=read_safeguards(table),
    )
    table.build(lambda: choice.build(choice.gain, nominal=(1.0,) * gain_count))
    return choice


def _reference(table: Table) -> ForceReference:
    axes = [axis for axis in "XYZ" if axis in table.entries]
    table.only(*(axes or "XYZ"))
    return ForceReference(steps=tuple(read_steps(table.table(axis)) for axis in axes))


def _beside(scenario_file: Path, name_or_path: str) -> str:
    """A path relative to the scenario file as one that works from anywhere; names stay."""
    candidate = scenario_file.parent / name_or_path
    return str(candidate.resolve()) if candidate.is_file() else name_or_path
