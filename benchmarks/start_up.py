"""Whole processes, Python's start included: what a person waits for."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.measure import Result

REFERENCE = "python -c 'import numpy, casadi'"
"""What no study can do without."""
_FRAME_RATE = 25.0


def start_up(*, rounds: int) -> list[Result]:
    """Processor time (s) of commands with 10 s of motion; they take turns with the reference."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        mrac = [sys.executable, "-m", "mrac_design"]
        simulate = [*mrac, "simulate", "--duration", "10"]
        recorded = ["--motion", str(_recording(folder)), "--point", "p1"]
        commands = {
            REFERENCE: [sys.executable, "-c", "import numpy, casadi"],
            "mrac --help": [*mrac, "--help"],
            "mrac with a mistyped option": [*simulate, "--omgea", "300"],
            "mrac simulate, warm": simulate,
            "mrac simulate of a recording, warm": [*simulate, *recorded],
            "mrac simulate, cold": simulate,
        }
        times: dict[str, list[tuple[float, float]]] = {name: [] for name in commands}
        for turn in range(rounds + 1):
            for name, command in commands.items():
                cache = folder / ("cold" if name.endswith("cold") else "warm")
                shutil.rmtree(folder / "cold", ignore_errors=True)
                spent = _spent(command, cache)
                if turn:  # the first turn fills the caches
                    times[name].append(spent)
    return [_result(name, np.array(turns)) for name, turns in times.items()]


def _spent(command: list[str], cache: Path) -> tuple[float, float]:
    """Processor time of the command and all it starts, and wall time (s)."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache)}
    # Python's own cache of compiled modules, as every installation has it.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    environment["PYTHONPYCACHEPREFIX"] = str(cache.parent / "bytecode")
    before, begin = os.times(), time.perf_counter()
    subprocess.run(command, env=environment, capture_output=True, check=False)
    wall, after = time.perf_counter() - begin, os.times()
    user = after.children_user - before.children_user
    return user + after.children_system - before.children_system, wall


def _result(name: str, turns: np.ndarray) -> Result:
    wall = np.median(turns[:, 1])
    return Result(
        name=name, turns=turns[:, 0], error=None, setup=0.0, note=f"{wall:.2f} s on the clock"
    )


def _recording(folder: Path) -> Path:
    """Camera frames of a point that beats and breathes, millimetres."""
    time_ = np.arange(int(11 * _FRAME_RATE)) / _FRAME_RATE
    beat, breath = np.sin(2 * np.pi * 1.2 * time_), np.sin(2 * np.pi * 0.25 * time_)
    table = np.stack([np.arange(time_.size), beat, breath, 3.0 * beat + breath], axis=1)
    path = folder / "track.csv"
    np.savetxt(path, table, delimiter=",", header="frame,p1_x_mm,p1_y_mm,p1_z_mm", comments="")
    return path
