"""What an exported step costs: memory, stack and instructions, measured where tools are found."""

from __future__ import annotations

import re
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
    with tempfile.TemporaryDirectory(prefix="mrac-count-") as name:
        folder = Path(name)
        program = folder / "selftest"
        sources = [str(package / f"mrac_{part}.c") for part in ("controller", "selftest")]
        flags = ["-std=c99", "-O2", "-ffp-contract=off"]
        built = _run([compiler, *flags, *sources, "-o", str(program), "-lm"], folder)
        if built is None:
            return _unmeasured(operations, f"{compiler} could not compile it at export")
        stack = _stack_bytes(compiler, [*flags, "-c", sources[0]], folder)
        version = (_run([compiler, "--version"], folder) or "").partition("\n")[0]
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


def _stack_bytes(compiler: str, arguments: list[str], folder: Path) -> int | None:
    _run([compiler, *arguments, "-fstack-usage", "-o", str(folder / "controller.o")], folder)
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
            command, capture_output=True, text=True, check=False, cwd=folder, timeout=_TIMEOUT
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return result.stdout + result.stderr if result.returncode == 0 else None
