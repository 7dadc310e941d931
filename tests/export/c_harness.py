"""Compiles an exported package with a loop around `mrac_step` and drives it from NumPy."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from mrac_design.controller.robot_step import RobotStep
from mrac_design.export.c_expressions import RealType

WARNINGS = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")

_LOOP = r"""
#include "mrac_controller.h"
/* Runs n steps; a negative n begins at the given state instead of at rest. */
int replay(long n, const mrac_parameters *parameters, const mrac_real *force,
           const mrac_inputs *inputs, mrac_outputs *outputs, mrac_state *state)
{
    int finite = 1;
    if (n >= 0) mrac_reset(state, parameters, force);
    else n = -n;
    for (long i = 0; i < n; ++i)
        finite &= mrac_step(state, parameters, inputs + i, outputs + i);
    return finite;
}
"""


def tool(name: str) -> str:
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"{name} is not installed")
    return path


def command(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(word) for word in words],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        env={**os.environ, "LD_BIND_NOW": "1"},  # else a first call counts the dynamic linker
    )


def build_self_test(package: Path, program: Path, compiler: str, *flags: str) -> Path:
    sources = sorted(package.glob("*.c"))
    built = command(tool(compiler), *WARNINGS, *flags, *sources, "-o", program, "-lm")
    assert built.returncode == 0, built.stderr
    return program


@dataclass
class Controller:
    """An exported controller loaded into this process."""

    library: ctypes.CDLL
    step: RobotStep
    number: RealType

    @classmethod
    def load(
        cls, step: RobotStep, package: Path, number: RealType, compiler: str = "cc", *flags: str
    ) -> Controller:
        loop, library = package / "loop.c", package / f"{Path(compiler).name}.so"
        loop.write_text(_LOOP)
        built = command(
            tool(compiler), "-std=c99", "-O2", "-ffp-contract=off", *flags, "-shared", "-fPIC",
            loop, package / "mrac_controller.c", "-o", library, "-lm",
        )  # fmt: skip
        assert built.returncode == 0, built.stderr
        return cls(ctypes.CDLL(str(library)), step, number)

    def run(
        self,
        rows: np.ndarray,
        *,
        force: np.ndarray | None = None,
        state: np.ndarray | None = None,
        parameters: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
        """Torques, signals, final state and whether all is finite, from rest or from `state`."""
        kind = self.number.dtype
        n = self.step.robot.joint_count
        own = self.step.parameter_values if parameters is None else parameters
        outputs = np.zeros((len(rows), n + self.step.signals.size), kind)
        memory = np.array(np.zeros(self.step.state.size) if state is None else state, kind)
        arrays = [
            np.ascontiguousarray(own, kind),
            np.ascontiguousarray(np.zeros(3) if force is None else force, kind),
            np.ascontiguousarray(rows, kind),
            outputs,
            memory,
        ]
        count = len(rows) if state is None else -len(rows)
        pointers = (array.ctypes.data_as(ctypes.c_void_p) for array in arrays)
        finite = self.library.replay(ctypes.c_long(count), *pointers)
        return outputs[:, :n], outputs[:, n:], memory, bool(finite)
