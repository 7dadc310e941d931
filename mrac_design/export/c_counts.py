"""What an exported step costs: memory, stack and instructions, measured where tools are found."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

from mrac_design.simulation.compilation import find_compiler

_TIMEOUT = 60.0
_COLLECTED = re.compile(r"Collected\s*:\s*(\d+)")


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCosts:
    """Costs of one call of `mrac_step`; what no tool could measure is None."""

    operations: int
    """Floating-point operations of the expression graph."""
    instructions: float | None
    """Instructions executed a step on the exporting machine (callgrind), averaged."""
    stack_bytes: int | None
    """Stack the step needs on the exporting machine (gcc -fstack-usage)."""
    tools: str
    """What measured, or why nothing could be measured."""


def measure_step(package: Path, *, operations: int, steps: int) -> StepCosts:
    """Compile the self-test of `package` and count instructions over its `steps` steps.

    Never fails: without compiler or valgrind the count of `operations` stands alone.
    """
    compiler, valgrind = find_compiler(), shutil.which("valgrind")
    if compiler is None:
        return _unmeasured(operations, "no C compiler was found at export")
    command = shlex.split(compiler)
    with tempfile.TemporaryDirectory(prefix="mrac-count-") as scratch:
        folder = Path(scratch)
        program = folder / "selftest"
        main, part = (str(package / f"mrac_{name}.c") for name in ("selftest", "controller"))
        flags = ["-std=c99", "-O2", "-ffp-contract=off"]
        unit = str(folder / "controller.o")
        # Not every compiler knows how to tell the stack; all know how to do without.
        compiled = any(
            _run([*command, *flags, *more, "-c", part, "-o", unit], folder) is not None
            for more in (["-fstack-usage"], [])
        )
        linked = [*command, *flags, main, unit, "-o", str(program), "-lm"]
        if not compiled or _run(linked, folder) is None:
            return _unmeasured(operations, f"{compiler} could not compile it at export")
        stack = _stack_bytes(folder)
        version = (_run([*command, "--version"], folder) or "").partition("\n")[0]
        if valgrind is None:
            return StepCosts(
                operations=operations,
                instructions=None,
                stack_bytes=stack,
                tools=f"{version}, -O2; no valgrind to count instructions with",
            )
        command = [
            valgrind, "--tool=callgrind", "--collect-atstart=no", "--toggle-collect=mrac_step",
            f"--callgrind-out-file={folder / 'counts'}", str(program),
        ]  # fmt: skip
        counted = _COLLECTED.search(_run(command, folder) or "")
    return StepCosts(
        operations=operations,
        instructions=None if counted is None else int(counted.group(1)) / steps,
        stack_bytes=stack,
        tools=f"{version}, -O2; callgrind",
    )


def _unmeasured(operations: int, reason: str) -> StepCosts:
    return StepCosts(operations=operations, instructions=None, stack_bytes=None, tools=reason)


def _stack_bytes(folder: Path) -> int | None:
    for usage in folder.glob("*.su"):
        for line in usage.read_text().splitlines():
            place, size, *_ = line.split("\t")
            if place.endswith(":mrac_step"):
                return int(size)
    return None


def _run(command: list[str], folder: Path) -> str | None:
    """Everything the command printed, None when it failed."""
    try:
        result = subprocess.run(
            command, capture_output=True, text=True, check=False, cwd=folder, timeout=_TIMEOUT,
            env={**os.environ, "LD_BIND_NOW": "1"},  # the dynamic linker's work is not the step's
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return None
    return result.stdout + result.stderr if result.returncode == 0 else None
