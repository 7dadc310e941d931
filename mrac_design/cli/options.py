"""Options of the commands; those that change a scenario are written once for all of them."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Collection
from dataclasses import dataclass, fields, replace
from enum import Enum
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

if TYPE_CHECKING:  # loading it takes longer than `--help` should
    from mrac_design.simulation.scenario import Scenario

JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON for machines.")]
"""The option of every command that can answer in JSON."""


class RealChoice(Enum):
    """Floating-point types of the exported C."""

    DOUBLE = "double"
    FLOAT = "float"


def _option(*names: str, text: str, panel: str) -> Any:
    return typer.Option(*names, help=text, rich_help_panel=panel)


_SCENARIO, _DESIGN = "Scenario", "Design"


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignOptions:
    """A scenario and changes to its design."""

    scenario: Annotated[
        str,
        _option("--scenario", "-s", text="Packaged scenario or TOML file.", panel=_SCENARIO),
    ] = "nominal"
    k2: Annotated[
        float | None, _option("--k2", text="Velocity loop gain K2 (1/s).", panel=_DESIGN)
    ] = None
    omega: Annotated[
        float | None, _option("--omega", text="Reference model ω (rad/s).", panel=_DESIGN)
    ] = None
    xi: Annotated[
        float | None, _option("--xi", text="Reference model damping ξ.", panel=_DESIGN)
    ] = None
    ao: Annotated[
        float | None, _option("--ao", text="Observer pole ao (rad/s).", panel=_DESIGN)
    ] = None

    def chosen(self) -> Scenario:
        """The named scenario with these changes."""
        from mrac_design.simulation.scenario import load_scenario

        base = load_scenario(self.scenario)
        design = _changed(
            base.design,
            velocity_gain=self.k2,
            bandwidth=self.omega,
            damping=self.xi,
        )
        if self.ao is not None:
            design = design.with_observer_pole(self.ao)
        return replace(base, design=design)


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyOptions(DesignOptions):
    """A scenario and changes to anything a study depends on."""

    gain: Annotated[
        float | None, _option("--gain", text="Scaled adaptation gain γ̂.", panel=_DESIGN)
    ] = None
    robot: Annotated[
        str | None, _option("--robot", text="Packaged robot or robot file.", panel=_SCENARIO)
    ] = None
    motion: Annotated[
        str | None,
        _option("--motion", text="Packaged motion or recording (CSV, .mat).", panel=_SCENARIO),
    ] = None
    point: Annotated[
        str | None, _option("--point", text="Tracked point of the recording.", panel=_SCENARIO)
    ] = None
    frame_rate: Annotated[
        float | None,
        _option("--frame-rate", text="Frames a second of the recording (Hz).", panel=_SCENARIO),
    ] = None
    cutoff: Annotated[
        float | None,
        _option("--cutoff", text="Low-pass on the recording (Hz).", panel=_SCENARIO),
    ] = None
    stiffness: Annotated[
        float | None, _option("--stiffness", text="True tissue Ks (N/m).", panel=_SCENARIO)
    ] = None
    duration: Annotated[
        float | None, _option("--duration", text="Simulated time (s).", panel=_SCENARIO)
    ] = None

    def chosen(self) -> Scenario:
        base = DesignOptions.chosen(self)
        return replace(
            base,
            robot=base.robot if self.robot is None else self.robot,
            stiffness=base.stiffness if self.stiffness is None else self.stiffness,
            adaptation=_changed(base.adaptation, gain=self.gain),
            simulation=_changed(base.simulation, duration=self.duration),
            motion=_changed(
                base.motion,
                source=self.motion,
                point=self.point,
                frame_rate=self.frame_rate,
                cutoff=self.cutoff,
            ),
        )


def takes(
    options: type[DesignOptions], *, without: Collection[str] = ()
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the fields of `options` as command-line options, but for those `without`.

    The command receives them as one value, its first argument.
    """
    offered = [field for field in fields(options) if field.name not in without]

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        hints = get_type_hints(options, include_extras=True)
        own_hints = get_type_hints(command, include_extras=True)
        shared = [
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=field.default,
                annotation=hints[field.name],
            )
            for field in offered
        ]
        own = [
            parameter.replace(
                kind=inspect.Parameter.KEYWORD_ONLY, annotation=own_hints[parameter.name]
            )
            for parameter in list(inspect.signature(command).parameters.values())[1:]
        ]

        @functools.wraps(command)
        def wrapper(**values: Any) -> None:
            chosen = options(**{field.name: values.pop(field.name) for field in offered})
            command(chosen, **values)

        wrapper.__signature__ = inspect.Signature(shared + own)  # type: ignore[attr-defined]
        return wrapper

    return decorate


def _changed(section: Any, **changes: Any) -> Any:
    """`section` with those changes that were given."""
    return replace(section, **{name: value for name, value in changes.items() if value is not None})
