"""What a command loads: nothing that takes long and is not needed."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from mrac_design.simulation.compilation import find_compiler

NUMERICAL = ("numpy", "casadi", "flint", "scipy")
RARELY_NEEDED = (
    "control", "cvxpy", "dask", "distributed", "email", "IPython", "jsonschema",
    "llvmlite", "matplotlib", "numpy.ma", "pandas", "pydantic", "scipy", "tomli_w", "xarray",
    "yaml", "zarr",
)  # fmt: skip
RUN = """
import sys
sys.argv[0] = "mrac"
from mrac_design.__main__ import main
try:
    main()
finally:
    print(*sys.modules, file=sys.stderr)
"""


def loaded(*arguments: str, status: int = 0) -> set[str]:
    """Modules in memory at the end of `mrac ARGUMENTS`."""
    done = subprocess.run(
        [sys.executable, "-c", RUN, *arguments], capture_output=True, text=True, check=False
    )
    assert done.returncode == status, done.stderr
    return set(done.stderr.splitlines()[-1].split())


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (("--help",), 0),
        (("simulate", "--help"), 0),
        (("simulate", "--omgea", "300"), 2),
        (("report", "--duration", "long"), 2),
    ],
)
def test_help_and_mistakes_load_no_numbers(arguments, status):
    modules = loaded(*arguments, status=status)
    assert "mrac_design.cli.app" in modules
    assert modules.isdisjoint({*NUMERICAL, *RARELY_NEEDED})


@pytest.fixture
def recording(tmp_path):
    """Two seconds of a point that circles slowly, millimetres."""
    angle = 2 * np.pi * np.arange(51) / 50
    track = np.stack([np.arange(51), np.cos(angle), np.sin(angle), np.cos(angle)], axis=1)
    file = tmp_path / "track.csv"
    np.savetxt(file, track, delimiter=",", header="frame,p1_x_mm,p1_y_mm,p1_z_mm", comments="")
    return str(file)


@pytest.mark.skipif(find_compiler() is None, reason="without a C compiler LLVM is needed")
def test_simulate_loads_only_what_it_computes_with(recording):
    motion = ("--motion", recording, "--point", "p1", "--frame-rate", "25")
    loaded("simulate", "--duration", "0.6", *motion)  # SciPy smooths a recording once
    for extra in ((), motion):
        modules = loaded("simulate", "--duration", "0.6", *extra)
        assert {"numpy", "casadi", "rich.table"} <= modules
        assert modules.isdisjoint(RARELY_NEEDED)


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler here")
def test_a_known_study_generates_no_code():
    loaded("simulate", "--duration", "0.6")
    again = loaded("simulate", "--duration", "0.6")
    assert "mrac_design.simulation.program" not in again
    assert "mrac_design.codegen.passes" not in again
