"""Tables of the three simulations of [Z], side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.report.paper import PAPER_TORQUE_LIMIT, PaperStudy, paper_error
from mrac_design.report.tables import Table, largest_errors
from mrac_design.study import VARIANTS, StudyRecord


def condition_table(studies: Sequence[PaperStudy]) -> Table:
    """What distinguishes the simulations."""
    return Table(
        caption=(
            "Conditions of the three simulations; everything else is the same. The robot model's "
            "error is a factor on the true values: on every body's mass, first moment and inertia, "
            "and on the first joint's row of the dynamics."
        ),
        header=("simulation", "true $K_s$", "$K_s$ of the design", "bodies", "first joint's row"),
        rows=tuple(
            (
                item.simulation.title,
                f"{item.study.scenario.stiffness:g} N/m",
                f"{item.study.scenario.design.stiffness:g} N/m",
                *_factors(item.study),
            )
            for item in studies
        ),
        numeric=(1, 2, 3, 4),
    )


def summary_table(studies: Sequence[PaperStudy]) -> Table:
    """Every simulation and axis: force errors of [Z] and of every variant, torques."""
    settling = studies[0].study.scenario.simulation.settling
    return Table(
        caption=(
            "Left: largest $|y - F_d|$ in per cent of the axis's largest desired force; – where "
            "[Z] gives no figure. Middle: rms of $y - y_m$, the distance from the reference "
            f"model, in mN. Both after the first {settling:g} s. Right: largest share of any "
            "motor's limit that any controller takes, the start included."
        ),
        header=(
            "sim.", "axis", "[Z]", "frozen RST", "adaptive", "adaptive + inverse",
            "rms frozen, mN", "rms adaptive, mN", "rms + inverse, mN", "torque / limit",
        ),
        rows=tuple(
            (
                f"{item.simulation.number}" if i == 0 else "",
                axis,
                paper_error(item.simulation, axis),
                *largest_errors(item.study, axis),
                *(f"{1e3 * rms:.3g}" for rms in _model_errors(item.study, axis)),
                _worst_share(item.study) if i == 0 else "",
            )
            for item in studies
            for i, axis in enumerate(item.study.robot.force_axes)
        ),
        numeric=tuple(range(2, 10)),
    )  # fmt: skip


def torque_comparison_table(studies: Sequence[PaperStudy]) -> Table:
    """Largest torque of each motor in each simulation: of the whole run, and after its start."""
    joints = studies[0].study.robot.joints
    limits = studies[0].study.robot.motor_torque_limits
    later = [
        np.max([later_torque(item.study, variant.name) for variant in VARIANTS], axis=0)
        for item in studies
    ]
    numbers = [item.simulation.number for item in studies]
    return Table(
        caption=(
            "Largest torque of each motor in N·m, the worst of the three controllers: over the "
            "whole run, which begins at rest on a moving heart, and after the time that is left "
            f"out. [Z] limits every actuator to {PAPER_TORQUE_LIMIT:g} N·m; the limits here belong "
            "to the stand-in robot."
        ),
        header=(
            "motor",
            "limit",
            *(f"sim. {number}" for number in numbers),
            *(f"sim. {number}, later" for number in numbers),
        ),
        rows=tuple(
            (
                joint.name,
                f"{limits[i]:g}",
                *(f"{_largest_torque(item.study, joint.name):.3g}" for item in studies),
                *(f"{peaks[i]:.3g}" for peaks in later),
            )
            for i, joint in enumerate(joints)
        ),
        numeric=tuple(range(1, 2 + 2 * len(studies))),
    )


def largest_share(study: StudyRecord, variant: str) -> float:
    """Largest share of any motor's limit that a variant takes, its start included."""
    peaks = study.max_torque[variant]
    limits = zip(study.robot.joints, study.robot.motor_torque_limits, strict=True)
    return max(peaks[joint.name] / float(limit) for joint, limit in limits)


def later_torque(study: StudyRecord, variant: str) -> FloatArray:
    """Largest torque of each motor (N·m) after the settling time, shape (n,)."""
    run_ = study.trajectories[variant]
    kept = run_.time >= study.scenario.simulation.settling
    return np.asarray(np.abs(run_["torque"][kept]).max(axis=0))


def _worst_share(study: StudyRecord) -> str:
    return f"{100 * max(largest_share(study, variant.name) for variant in VARIANTS):.1f} %"


def _largest_torque(study: StudyRecord, motor: str) -> float:
    return max(peaks[motor] for peaks in study.max_torque.values())


def _model_errors(study: StudyRecord, axis: str) -> tuple[float, ...]:
    return tuple(study.tracking[variant.name][axis].rms_model_error_N for variant in VARIANTS)


def _factors(study: StudyRecord) -> tuple[str, str]:
    error = study.scenario.model_error
    return f"× {error.body_scale:g}", f"× {error.body_scale * error.first_joint_scale:g}"
