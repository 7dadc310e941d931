"""`mrac export`: the tuned controller in the form a robot's computer takes."""

from __future__ import annotations

import json
import sys
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from mrac_design.cli_options import StudyOptions, takes
from mrac_design.errors import ParameterError

_output = Console()


class ControllerChoice(Enum):
    """Controllers that can be exported, by the names of a study's variants."""

    FROZEN = "frozen"
    ADAPTIVE = "adaptive"
    ADAPTIVE_INVERSE = "adaptive_inverse"


class RealChoice(Enum):
    """Floating-point types of the exported C."""

    DOUBLE = "double"
    FLOAT = "float"


@takes(StudyOptions)
def export(
    options: StudyOptions,
    c: Annotated[
        Path | None,
        typer.Option("--c", help="Folder for the C package; new, empty or of an earlier package."),
    ] = None,
    rate: Annotated[float, typer.Option(help="Sampling rate of the controller (Hz).")] = 1000.0,
    controller: Annotated[
        ControllerChoice, typer.Option(help="Which of the study's controllers.")
    ] = ControllerChoice.ADAPTIVE_INVERSE,
    real: Annotated[
        RealChoice, typer.Option(help="Floating-point type of the C code.")
    ] = RealChoice.DOUBLE,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON for machines.")] = False,
) -> None:
    """Export the sampled controller, linearising torque included.

    Example: mrac export --c build/controller --rate 2000 --omega 300
    """
    from mrac_design.export.c_expressions import DOUBLE, FLOAT
    from mrac_design.export.c_package import export_c_package
    from mrac_design.export.gains import gains_document
    from mrac_design.export.scenario_step import scenario_robot_step
    from mrac_design.study import VARIANTS, scenario_design

    if c is None:
        raise ParameterError("export", "nothing", "name what to write: --c FOLDER")
    if not 0 < rate < float("inf"):
        raise ParameterError("rate", rate, "must be a positive sampling rate in Hz")
    scenario = options.chosen()
    design = scenario_design(scenario)
    variant = next(item for item in VARIANTS if item.name == controller.value)
    step = scenario_robot_step(scenario, design, variant, period=1.0 / rate)
    package = export_c_package(
        step,
        c,
        number=DOUBLE if real is RealChoice.DOUBLE else FLOAT,
        gains_hash=gains_document(scenario, design)["hash"],
        title=f"{scenario.title}: {variant.title}",
    )
    if as_json:
        sys.stdout.write(json.dumps(package.summary(), indent=2) + "\n")
        return
    for name, value in package.summary().items():
        _output.print(f"{name.replace('_', ' ')}: {value}", highlight=False, soft_wrap=True)
