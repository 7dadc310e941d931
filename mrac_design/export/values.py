"""The numbers of a study as plain data, for `values.json` and for `--json`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from mrac_design.study import StudyRecord


def study_values(study: StudyRecord) -> dict[str, Any]:
    """Figures of merit with what they rest on; every number was computed in this run."""
    from importlib.metadata import version  # loads all that reads mail headers

    motion = study.motion
    return {
        "mrac_design": version("mrac-design"),
        "scenario": study.scenario.name,
        "robot": study.robot.name,
        "motion": {
            "name": motion.name,
            "origin": motion.origin.value,
            "source": motion.source,
            "assumptions": list(motion.assumptions),
        },
        "duration_s": study.scenario.simulation.duration,
        "settling_s": study.scenario.simulation.settling,
        "engine": next(iter(study.trajectories.values())).engine,
        "metrics": {
            variant: {axis: asdict(metrics) for axis, metrics in axes.items()}
            for variant, axes in study.tracking.items()
        },
        "max_torque_Nm": {variant: dict(peaks) for variant, peaks in study.max_torque.items()},
        "torque_limit_Nm": {joint.name: joint.motor_torque_limit for joint in study.robot.joints},
        "events": {
            variant: [
                {"time_s": event.time, "name": event.event.name, "change": event.change}
                for event in trajectory.events
            ]
            for variant, trajectory in study.trajectories.items()
        },
        "worst_jacobian_condition": study.worst_condition,
    }
