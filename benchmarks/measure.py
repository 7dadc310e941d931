"""Timing on a machine that others use too: processor time, interleaved, medians."""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from mrac_design.simulation.compilation import _version, find_compiler

TURN = 4e-3
"""Shortest turn (s): a call on cold caches says nothing about the next thousand."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Result:
    """One contestant's figures."""

    name: str
    """Who, with what setting."""
    turns: np.ndarray
    """Processor time per unit of work in each round."""
    error: float | None
    """Largest deviation from the reference solution; None where it does not apply."""
    setup: float
    """Time before the first result (s), code from a cache not counted as such."""
    note: str = ""
    """What is not alike."""

    @property
    def cost(self) -> float:
        """Median over the rounds."""
        return float(np.median(self.turns))


@dataclass(frozen=True, slots=True)
class Ratio:
    """How many times as long one takes as the other, by rounds."""

    low: float
    """First quartile."""
    median: float
    """Second quartile."""
    high: float
    """Third quartile."""

    @classmethod
    def of(cls, slow: Result, fast: Result) -> Ratio:
        """Round by round, as both met the same machine then."""
        low, median, high = np.quantile(slow.turns / fast.turns, (0.25, 0.5, 0.75))
        return cls(float(low), float(median), float(high))

    def __str__(self) -> str:
        return f"{self.median:.3g} ({self.low:.3g} to {self.high:.3g})"


def interleaved(
    contestants: Mapping[str, Callable[[], object]], *, rounds: int, turn: float = TURN
) -> dict[str, np.ndarray]:
    """Processor time (s) of a call in each round; all take turns, so all meet the same machine."""
    repeats = {}
    for name, call in contestants.items():
        call()
        begin = time.thread_time()
        call()
        repeats[name] = max(1, math.ceil(turn / max(time.thread_time() - begin, 1e-7)))
    times: dict[str, list[float]] = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, call in contestants.items():
            call()
            begin = time.thread_time()
            for _ in range(repeats[name]):
                call()
            times[name].append((time.thread_time() - begin) / repeats[name])
    return {name: np.array(values) for name, values in times.items()}


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
