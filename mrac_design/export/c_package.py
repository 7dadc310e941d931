"""The whole robot controller as a small C99 package: one `mrac_step`, nothing allocated.

The C is written from the expressions of `RobotStep.step` itself, the ones that are simulated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from string import Template

from mrac_design.controller.robot_step import RobotStep
from mrac_design.errors import FileError
from mrac_design.export.c_counts import StepCosts, measure_step
from mrac_design.export.c_expressions import RealType, operation_count
from mrac_design.export.c_selftest import build_self_test, tolerance
from mrac_design.export.c_text import cost_texts, package_texts
from mrac_design.publishing import publish_file, publish_folder, staging_folder

_TEMPLATES = Path(__file__).parent / "c_templates"
_COPIED = ("CMakeLists.txt",)
_SOURCES = (
    "mrac_controller.h",
    "mrac_controller.c",
    "mrac_selftest.c",
    "mrac_selftest_vectors.h",
)
_README = "README.md"


@dataclass(frozen=True, slots=True, kw_only=True)
class CPackage:
    """What was written."""

    directory: Path
    """The package's folder."""
    parameters_hash: str
    """SHA-256 of names, values and period, as `mrac_identity` tells it."""
    state_bytes: int
    """Size of the state struct."""
    parameter_bytes: int
    """Size of the parameter struct."""
    tolerance: float
    """Largest deviation the self-test accepts (–); 0 is bit for bit."""
    costs: StepCosts
    """Cost of a step."""

    def summary(self) -> dict[str, str | float | None]:
        """The same as plain data, sizes in bytes."""
        return {
            "directory": str(self.directory),
            "parameters_hash": self.parameters_hash,
            "state_bytes": self.state_bytes,
            "parameter_bytes": self.parameter_bytes,
            "self_test_tolerance": self.tolerance,
            "operations": self.costs.operations,
            "instructions": self.costs.instructions,
            "stack_bytes": self.costs.stack_bytes,
            "measured_with": self.costs.tools,
        }

    def _repr_markdown_(self) -> str:
        rows = "\n".join(
            f"| {name.replace('_', ' ')} | {value} |" for name, value in self.summary().items()
        )
        return f"| C package | |\n|---|---|\n{rows}"


def export_c_package(
    step: RobotStep, directory: Path, *, number: RealType, gains_hash: str, title: str
) -> CPackage:
    """Write `step` as a C99 package into `directory`.

    `number` is `DOUBLE` or `FLOAT`; `gains_hash` ties the package to a gains document. A new
    folder appears whole or not at all; in the folder of an earlier package each file is replaced
    in a single step, and what else lies there stays. Raises FileError when `directory` holds
    something else or cannot be written.
    """
    _require_own(directory)
    test = build_self_test(step)
    accepted = tolerance(step, test, number)
    texts = package_texts(
        step, number, test=test, tolerance=accepted, gains_hash=gains_hash, title=title
    )
    try:
        with staging_folder(directory) as staging:
            package = staging / "package"
            package.mkdir()
            for name in _COPIED:
                (package / name).write_bytes((_TEMPLATES / name).read_bytes())
            for name in _SOURCES:
                _fill(name, texts, package)
            operations = operation_count(step.step)
            costs = measure_step(package, operations=operations, steps=len(test.inputs))
            _fill(_README, texts | cost_texts(step, number, costs), package)
            _publish(package, directory)
    except OSError as problem:
        raise FileError(
            directory, "", f"the C package cannot be written: {problem.strerror or problem}"
        ) from problem
    return CPackage(
        directory=directory,
        parameters_hash=texts["parameters_hash"],
        state_bytes=step.state.size * number.dtype.itemsize,
        parameter_bytes=step.parameters.size * number.dtype.itemsize,
        tolerance=accepted,
        costs=costs,
    )


def _require_own(directory: Path) -> None:
    if directory.is_dir():
        empty = next(directory.iterdir(), None) is None
        if empty or (directory / _SOURCES[0]).is_file():
            return
        raise FileError(
            directory, "", f"holds other files and no {_SOURCES[0]}: name a new or an empty folder"
        )
    if directory.exists():
        raise FileError(directory, "", "is a file: name a folder for the C package")


def _publish(package: Path, directory: Path) -> None:
    if not directory.exists():
        publish_folder(package, directory)
        return
    for name in (*_COPIED, *_SOURCES, _README):
        publish_file(package / name, directory / name)


def _fill(name: str, texts: Mapping[str, str], package: Path) -> None:
    template = Template((_TEMPLATES / name).read_text(encoding="utf-8"))
    (package / name).write_text(template.substitute(texts), encoding="utf-8")
