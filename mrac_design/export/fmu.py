"""The whole robot controller as a functional mock-up unit: FMI 2.0, co-simulation.

    master ─ q, qd, force, reference ─►│ step at every sampling instant │─ torque, signals ─►

The C inside is written from the expressions of `RobotStep.step`, the ones that are simulated;
with it travels a binary for this platform and the gains as JSON.
"""

from __future__ import annotations

import hashlib
import json
import platform
import shlex
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from string import Template

from mrac_design.controller.robot_step import RobotStep
from mrac_design.errors import CompilationError
from mrac_design.export.c_expressions import DOUBLE, c_statements
from mrac_design.export.fmu_description import (
    MODEL_IDENTIFIER,
    FmuVariable,
    fmu_variables,
    model_description,
)
from mrac_design.export.gain_document import document_of
from mrac_design.export.gain_set import GainSet
from mrac_design.export.writing import written_whole
from mrac_design.simulation.compilation import find_compiler

_SOURCE = f"{MODEL_IDENTIFIER}_fmi2.c"
_TEMPLATE = Path(__file__).parent / "fmu_templates" / _SOURCE
# An FMU travels: nothing of this very processor. No contraction, for the simulation's bits.
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
_EPOCH = (1980, 1, 1, 0, 0, 0)
"""Date of every entry of the archive: the same controller gives the same file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fmu:
    """What was written."""

    path: Path
    """The archive."""
    guid: str
    """Identifies interface and numbers."""
    platform: str | None
    """FMI's name of the platform the binary inside is for; None: sources only."""
    remark: str
    """What the user has to know, one sentence."""


def export_fmu(step: RobotStep, path: Path, *, gains: GainSet) -> Fmu:
    """Write `step`, made of `gains`, as an FMU; the file appears whole or not at all.

    Between two sampling instants inputs are ignored and outputs held; the torque of the sample
    at t is the output from the end of the communication step that begins at t. Raises
    CompilationError when a compiler is there and fails, FileError when the file cannot be written.
    """
    document = document_of(gains)
    variables = fmu_variables(step)
    title = f"mrac_controller {step.robot.name}"
    guid, source = _source(step, variables, title=title, gains_hash=document["hash"])
    description = model_description(
        step,
        variables,
        guid=guid,
        title=title,
        description=(
            f"Adaptive force control of {step.robot.name}, linearising torque included, every "
            f"{step.time_domain.period:g} s; gains {document['hash']}"
        ),
        version=version("mrac-design"),
        source=_SOURCE,
    )
    entries: dict[str, bytes] = {
        "modelDescription.xml": description.encode(),
        f"sources/{_SOURCE}": source.encode(),
        "resources/gains.json": (json.dumps(document, indent=2, ensure_ascii=False)).encode(),
    }
    with written_whole(path) as staged:
        target, remark = _built(source, staged.parent, entries)
        _write_archive(entries, staged)
    return Fmu(path=path, guid=guid, platform=target, remark=remark)


def _built(source: str, folder: Path, entries: dict[str, bytes]) -> tuple[str | None, str]:
    """Add a binary to `entries` where that is possible; platform and a sentence about it."""
    compiler, target = find_compiler(), _platform()
    if target is None:
        return None, (
            f"FMI 2 has no name for this platform ({sys.platform}, {platform.machine()}), so the "
            "FMU holds sources and no binary; let the tool that runs it compile them"
        )
    if compiler is None:
        return None, (
            "no C compiler was found, so the FMU holds sources and no binary; install gcc or "
            "clang, or name one in CC, and export again, or let a tool compile the sources"
        )
    name, suffix = target
    binary = _compiled(source, folder, compiler, suffix)
    entries[f"binaries/{name}/{MODEL_IDENTIFIER}{suffix}"] = binary
    return name, f"the FMU holds a binary for {name} and its sources"


def _source(
    step: RobotStep, variables: tuple[FmuVariable, ...], *, title: str, gains_hash: str
) -> tuple[str, str]:
    """GUID and C source; the GUID is a digest of everything else in the source."""
    n, k = step.robot.joint_count, len(step.robot.force_axes)
    fields = {
        "title": title,
        "robot": step.robot.name,
        "period": f"{step.time_domain.period:g}",
        "period_literal": DOUBLE.literal(step.time_domain.period),
        "version": version("mrac-design"),
        "gains_hash": gains_hash,
        "inputs": str(2 * n + 2 * k),
        "outputs": str(n + step.signals.size),
        "values": str(len(variables)),
        "states": str(step.state.size),
        "torques": str(n),
        "start": "\n".join(
            f"    {DOUBLE.literal(v.start or 0.0)}, /* {v.name} */" for v in variables
        ),
        **_statements(step),
    }
    digest = hashlib.sha256(repr((sorted(fields.items()), variables)).encode()).hexdigest()
    template = Template(_TEMPLATE.read_text(encoding="utf-8"))
    return digest, template.substitute(fields, guid=digest)


def _statements(step: RobotStep) -> Mapping[str, str]:
    """The step's expressions on the arrays `values` and `state`."""
    n, k = step.robot.joint_count, len(step.robot.force_axes)
    ends, names = 0, []
    for size in (n, n, k, k, n, step.signals.size, step.parameters.size):
        names.append([f"values[{i}]" for i in range(ends, ends + size)])
        ends += size
    *inputs, torque, signals, parameters = names
    state = [f"state[{i}]" for i in range(step.state.size)]
    stepped = c_statements(
        step.step,
        inputs=[state, *inputs, parameters],
        outputs=[state, torque, signals],
        real="double",
        number=DOUBLE,
    )
    rested = c_statements(
        step.equilibrium,
        inputs=[inputs[2], parameters],
        outputs=[state],
        real="double",
        number=DOUBLE,
    )
    return {
        "step_statements": "\n".join(f"    {line}" for line in stepped),
        "reset_statements": "\n".join(f"    {line}" for line in rested),
    }


def _platform() -> tuple[str, str] | None:
    """FMI's name of this platform and the suffix of its libraries; None if FMI 2 has none."""
    known = {
        "linux": ("linux64", ".so"),
        "darwin": ("darwin64", ".dylib"),
        "win32": ("win64", ".dll"),
    }
    intel = platform.machine().lower() in ("x86_64", "amd64")
    return known.get(sys.platform) if intel and sys.maxsize > 2**32 else None


def _compiled(source: str, folder: Path, compiler: str, suffix: str) -> bytes:
    file, library = folder / _SOURCE, folder / f"{MODEL_IDENTIFIER}{suffix}"
    file.write_text(source, encoding="utf-8")
    command = [*shlex.split(compiler), *_FLAGS, str(file), "-o", str(library), "-lm"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise CompilationError(command, result.stderr)
    return library.read_bytes()


def _write_archive(entries: Mapping[str, bytes], path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            info = zipfile.ZipInfo(name, _EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, content)
