"""The exported controller in real time on this machine, against the simulated robot.

experiment, program → exchange → runner, which hands out a report of records.
"""

from mrac_design.realtime.record import (
    RealtimeRecord,
    RealtimeReport,
    RealtimeRun,
    TimePercentiles,
    TorqueAgreement,
)
from mrac_design.realtime.runner import run_realtime

__all__ = [
    "RealtimeRecord",
    "RealtimeReport",
    "RealtimeRun",
    "TimePercentiles",
    "TorqueAgreement",
    "run_realtime",
]
