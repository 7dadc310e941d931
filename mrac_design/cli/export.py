"""`mrac export`: the tuned controller in the form a robot's computer takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mrac_design.cli.console import output, print_json
from mrac_design.cli.options import JsonOption, RealChoice, StudyOptions, takes
from mrac_design.errors import ParameterError

if TYPE_CHECKING:  # loading them takes longer than `--help` should
    from mrac_design.controller.robot_step import RobotStep
    from mrac_design.export.gains import GainSet


Summary = Mapping[str, str | float | None]


class ControllerChoice(Enum):
    """Controllers that can be exported, by the names of a study's variants."""

    FROZEN = "frozen"
    ADAPTIVE = "adaptive"
    ADAPTIVE_INVERSE = "adaptive_inverse"


@takes(StudyOptions)
def export(
    options: StudyOptions,
    c: Annotated[
        Path | None,
        typer.Option("--c", help="Folder for the C package; new, empty or of an earlier package."),
    ] = None,
    gains: Annotated[
        list[Path] | None,
        typer.Option(help="File for the gains: .json, .toml, .yaml (ROS 2) or .mat; repeatable."),
    ] = None,
    fmu: Annotated[
        Path | None, typer.Option(help="File for the FMU (FMI 2.0, co-simulation).")
    ] = None,
    latex: Annotated[Path | None, typer.Option(help="File for the formulas (LaTeX).")] = None,
    source: Annotated[
        Path | None,
        typer.Option("--from", help="Gains file to export instead of a scenario's design."),
    ] = None,
    rate: Annotated[float, typer.Option(help="Sampling rate of C package and FMU (Hz).")] = 1000.0,
    controller: Annotated[
        ControllerChoice | None,
        typer.Option(help="Which of the study's controllers; without it adaptive_inverse."),
    ] = None,
    real: Annotated[
        RealChoice, typer.Option(help="Floating-point type of the C package.")
    ] = RealChoice.DOUBLE,
    as_json: JsonOption = False,
) -> None:
    """Export the controller: gains, C package, FMU, formulas; linearising torque included.

    Example: mrac export --c build/controller --gains gains.yaml --rate 2000 --omega 300
    """
    from mrac_design.export.gains import require_gains_suffix, robot_step_of
    from mrac_design.time_domain import Discrete

    files = gains or []
    if c is None and fmu is None and latex is None and not files:
        raise ParameterError(
            "export", "nothing", "name what to write: --c FOLDER, --gains, --fmu or --latex FILE"
        )
    if not 0 < rate < float("inf"):
        raise ParameterError("rate", rate, "must be a positive sampling rate in Hz")
    for file in files:
        require_gains_suffix(file)
    tuned = _tuned(options, controller, source)
    robot = options.chosen().robot
    done: dict[str, Summary] = {}
    if c is not None or fmu is not None:
        step = robot_step_of(tuned, robot, Discrete(1.0 / rate))
        if c is not None:
            done["c"] = _write_c(step, tuned, c, real)
        if fmu is not None:
            done["fmu"] = _write_fmu(step, tuned, fmu)
    if latex is not None:
        done["latex"] = _write_latex(tuned, robot, latex)
    for file in files:
        done[f"gains {file}"] = _write_gains(tuned, file)
    _print(done, as_json)


def _tuned(
    options: StudyOptions, controller: ControllerChoice | None, source: Path | None
) -> GainSet:
    """Gains of the scenario, or of a file."""
    from mrac_design.export.gains import gain_set, read_gains
    from mrac_design.study import VARIANTS, scenario_design

    if source is None:
        scenario = options.chosen()
        name = (controller or ControllerChoice.ADAPTIVE_INVERSE).value
        variant = next(item for item in VARIANTS if item.name == name)
        return gain_set(scenario, scenario_design(scenario), variant)
    for field in fields(options):
        given = getattr(options, field.name) is not None
        if given and field.name not in ("scenario", "robot"):
            raise ParameterError(
                "--from", source, f"holds a finished controller; {field.name} cannot change it"
            )
    if controller is not None:
        raise ParameterError(
            "--from", source, "holds a finished controller; --controller cannot change it"
        )
    return read_gains(source)


def _write_c(step: RobotStep, tuned: GainSet, folder: Path, real: RealChoice) -> Summary:
    from mrac_design.export.c_expressions import REAL_TYPES
    from mrac_design.export.c_package import export_c_package
    from mrac_design.export.gains import document_of

    package = export_c_package(
        step,
        folder,
        number=REAL_TYPES[real.value],
        gains_hash=document_of(tuned)["hash"],
        title=f"Adaptive force controller, {tuned.scenario}",
    )
    return package.summary()


def _write_fmu(step: RobotStep, tuned: GainSet, path: Path) -> Summary:
    from mrac_design.export.fmu import export_fmu

    written = export_fmu(step, path, gains=tuned)
    return {"file": str(path), "guid": written.guid, "remark": written.remark}


def _write_latex(tuned: GainSet, robot: str, path: Path) -> Summary:
    from mrac_design.export.formulas import write_formulas
    from mrac_design.export.gains import require_robot
    from mrac_design.robot import load_robot

    require_robot(tuned, robot)
    write_formulas(tuned, load_robot(robot), path)
    return {"file": str(path)}


def _write_gains(tuned: GainSet, path: Path) -> Summary:
    from mrac_design.export.gains import document_of, write_gains

    write_gains(tuned, path)
    return {"file": str(path), "hash": document_of(tuned)["hash"]}


def _print(done: Mapping[str, Summary], as_json: bool) -> None:
    if as_json:
        print_json(done)
        return
    for what, summary in done.items():
        output().print(what, style="bold", highlight=False)
        for name, value in summary.items():
            output().print(
                f"  {name.replace('_', ' ')}: {value}",
                highlight=False,
                soft_wrap=True,
                markup=False,
            )
