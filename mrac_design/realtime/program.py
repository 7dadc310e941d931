"""The program: the exported controller, the simulated robot and a loop on the system's clock."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from string import Template

from mrac_design.errors import CompilationError, RealtimeError
from mrac_design.realtime.experiment import TOLD, RealtimeExperiment
from mrac_design.simulation.compilation import compile_library, find_compiler
from mrac_design.simulation.program import c_program
from mrac_design.simulation.system import HybridSystem
from mrac_design.simulation.tableau import RK4

_TEMPLATES = Path(__file__).parent / "c_templates"
_COPIED = ("realtime_loop.h", "realtime_loop.c", "realtime_main.c")
_SIZES = "realtime_sizes.h"
CONTROLLER_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
"""How the controller is compiled: as where its instructions are counted."""
LOOP_FLAGS = ("-std=gnu99", "-O2")
"""How the loop around it is compiled; it holds no arithmetic of the controller's."""
_TIME_LIMIT = 120.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedRobot:
    """The compiled plant side of a loop; one serves every rate."""

    library: Path
    """Shared library with the generated `run`."""
    compiler: str
    """What compiled it."""


def require_compiler() -> str:
    """The C compiler. Raises RealtimeError where there is none, or no Linux."""
    if not sys.platform.startswith("linux"):
        raise RealtimeError(
            f"the real-time runner needs Linux and its clock; this is {sys.platform}"
        )
    compiler = find_compiler()
    if compiler is None:
        raise RealtimeError(
            "the real-time runner needs a C compiler and found none: install gcc or clang, or "
            "name one in the environment variable CC"
        )
    return compiler


def build_robot(experiment: RealtimeExperiment, compiler: str) -> SimulatedRobot:
    """Compile the simulated robot as the simulation compiles it, so that its bits are the same.

    Raises CompilationError when the compiler refuses.
    """
    powers = experiment.inputs.degree + 1
    source = c_program(experiment.plant, RK4, input_powers=powers)
    library = compile_library(source, compiler)
    return SimulatedRobot(library=Path(library._name), compiler=compiler)


def build_program(
    experiment: RealtimeExperiment, robot: SimulatedRobot, package: Path, folder: Path
) -> Path:
    """Compile the controller in `package` with loop and robot; returns the program in `folder`.

    Raises CompilationError when the compiler refuses, RealtimeError when `folder` is full.
    """
    program = folder / "realtime"
    compiler = shlex.split(robot.compiler)
    try:
        for name in _COPIED:
            (folder / name).write_bytes((_TEMPLATES / name).read_bytes())
        sizes = Template((_TEMPLATES / _SIZES).read_text(encoding="utf-8"))
        (folder / _SIZES).write_text(sizes.substitute(_places(experiment.plant)), encoding="utf-8")
    except OSError as problem:
        raise RealtimeError(f"{folder}: {problem.strerror or problem}; free some space") from None
    units = [
        (package / "mrac_controller.c", CONTROLLER_FLAGS),
        (folder / "realtime_loop.c", LOOP_FLAGS),
        (folder / "realtime_main.c", LOOP_FLAGS),
    ]
    objects = []
    for source, flags in units:
        target = folder / f"{source.stem}.o"
        where = [f"-I{package}", f"-I{folder}"]
        _compile([*compiler, *flags, *where, "-c", str(source), "-o", str(target)], folder)
        objects.append(str(target))
    _compile([*compiler, *objects, str(robot.library), "-o", str(program), "-lm"], folder)
    return program


def _places(plant: HybridSystem) -> dict[str, int]:
    where = plant.held.slices
    return {
        "states": plant.state.size,
        "held": plant.held.size,
        "parameters": plant.parameters.size,
        "pipeline_at": where["pipeline"].start,
        "pipeline_size": where["pipeline"].stop - where["pipeline"].start,
        "told_at": where[TOLD].start,
    }


def _compile(command: list[str], folder: Path) -> None:
    environment = {**os.environ, "TMPDIR": str(folder), "LC_ALL": "C"}
    try:
        result = subprocess.run(
            command,
            capture_output=True, text=True, check=False, timeout=_TIME_LIMIT, env=environment,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as problem:
        raise CompilationError(command, str(problem)) from problem
    if result.returncode != 0:
        raise CompilationError(command, result.stderr)
