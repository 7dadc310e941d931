"""The machine that latencies were measured on: without it they mean nothing."""

from __future__ import annotations

import os
import platform
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineDescription:
    """A computer, as far as its latencies depend on it."""

    processor: str
    """Model of the processor."""
    cores: int
    """Processors this program may use."""
    kernel: str
    """Kernel, its release and how it preempts."""
    load: float
    """Programs that wanted to run, averaged over the minute before; above `cores` it is busy."""

    def __str__(self) -> str:
        return f"{self.processor}, {self.cores} cores, {self.kernel}, load {self.load:.2g}"


def this_machine() -> MachineDescription:
    """The computer this runs on (Linux)."""
    system = os.uname()
    preemption = next((word for word in system.version.split() if word.startswith("PREEMPT")), "")
    return MachineDescription(
        processor=_processor(),
        cores=len(os.sched_getaffinity(0)),
        kernel=f"{system.sysname} {system.release} {preemption}".rstrip(),
        load=os.getloadavg()[0],
    )


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            name, _, value = line.partition(":")
            if name.strip() == "model name":
                return " ".join(value.split())
    except OSError:
        pass
    return platform.machine()
