"""Timing on a machine that others use too: processor time, interleaved, medians."""

from __future__ import annotations

import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """One contestant's figures."""

    name: str
    """Who, with what setting."""
    cost: float
    """Median processor time per unit of work."""
    error: float | None
    """Largest deviation from the reference solution; None where it does not apply."""
    setup: float
    """Time before the first result (s), code from a cache not counted as such."""
    note: str = ""
    """What is not alike."""


def interleaved(
    contestants: Mapping[str, Callable[[], object]], *, rounds: int
) -> dict[str, float]:
    """Median processor time (s) of each call; all take turns, so all meet the same machine."""
    times: dict[str, list[float]] = {name: [] for name in contestants}
    for call in contestants.values():
        call()
    for _ in range(rounds):
        for name, call in contestants.items():
            begin = time.thread_time()
            call()
            times[name].append(time.thread_time() - begin)
    return {name: float(np.median(values)) for name, values in times.items()}


def timed(build: Callable[[], object]) -> tuple[object, float]:
    """A value and the wall time (s) it took to make."""
    begin = time.perf_counter()
    value = build()
    return value, time.perf_counter() - begin


def machine() -> str:
    """What the figures were measured on."""
    name = platform.processor() or platform.machine()
    flags = ""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        fields = dict(line.split(":", 1) for line in lines if ":" in line)
        fields = {key.strip(): value.strip() for key, value in fields.items()}
        name = fields.get("model name", name)
        sets = ("avx2", "fma", "avx512f")
        flags = ", ".join(flag for flag in sets if flag in fields.get("flags", "").split())
    except OSError:
        pass
    import os

    from mrac_design.simulation.compilation import _version, find_compiler

    compiler = find_compiler()
    packages = ", ".join(
        f"{package} {_installed(package)}"
        for package in ("casadi", "heyoka", "mujoco", "pin", "control", "numpy", "llvmlite")
    )
    return (
        f"{name} ({flags}), {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; "
        f"{_version(compiler) if compiler else 'no compiler'}; "
        f"Python {platform.python_version()}, {packages}"
    )


def _installed(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
