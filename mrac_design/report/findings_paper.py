"""What the three simulations of [Z], repeated, say: sentences whose numbers come from the runs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.report.paper import PAPER_POSITION_ERROR, PaperStudy, paper_error
from mrac_design.report.tables_paper import largest_share, later_torque
from mrac_design.study import StudyRecord

_SAME = 1.05
"""Ratio of two errors up to which they count as the same: the heart alone moves them more."""
_HEART_BEAT = 1.0
"""Frequency (Hz) at which the sensitivity to the heart's motion is stated."""


def findings(studies: Sequence[PaperStudy]) -> tuple[str, ...]:
    """Markdown sentences on the three simulations, in the order of `PAPER_SIMULATIONS`."""
    nominal, parameters, stiffness = (item.study for item in studies)
    return (
        _stiffness(nominal, stiffness),
        _adaptation(studies),
        _model_error(parameters),
        _inverse(studies),
        _torques(nominal, stiffness),
        *_beside_paper(studies),
    )


def growth(first: StudyRecord, then: StudyRecord, variant: str) -> float:
    """How many times larger the largest force error is in `then`, on the axis that suffers most."""
    return max(
        np.divide(largest_percent(then, variant), largest_percent(first, variant), dtype=float)
    )


def largest_percent(study: StudyRecord, variant: str) -> tuple[float, ...]:
    """Largest force error by axis, % of the axis's largest desired force."""
    return tuple(metrics.max_force_error_percent for metrics in study.tracking[variant].values())


def adaptation_ratios(study: StudyRecord) -> tuple[float, ...]:
    """rms of y − ym of the adaptive over that of the frozen controller, by axis."""
    adaptive, frozen = study.tracking["adaptive"], study.tracking["frozen"]
    return tuple(
        adaptive[axis].rms_model_error_N / frozen[axis].rms_model_error_N for axis in frozen
    )


def lag_percent(study: StudyRecord) -> tuple[float, ...]:
    """Largest distance of the model's output from the desired force, by axis, as the errors."""
    run_ = study.trajectories["adaptive"]
    kept = run_.time >= study.scenario.simulation.settling
    lag = np.abs(run_["model_force"] - run_["desired_force"])[kept].max(axis=0)
    return tuple(float(x) for x in 100 * lag / np.abs(run_["desired_force"]).max(axis=0))


def mean_error(study: StudyRecord, variant: str) -> FloatArray:
    """Mean of y − ym (N) by axis after the settling time."""
    run_ = study.trajectories[variant]
    kept = run_.time >= study.scenario.simulation.settling
    return np.asarray((run_["force"] - run_["model_force"])[kept].mean(axis=0))


def frozen_sensitivity(study: StudyRecord, frequency: float = _HEART_BEAT) -> float:
    """|force error / heart motion| (N/m) at a frequency (Hz): frozen controller, true tissue."""
    design, stiffness = study.design, study.scenario.stiffness
    p = 2j * np.pi * frequency
    AR = np.polyval(study.plant.A, p) * np.polyval(design.R, p)
    return float(abs(stiffness * AR / (AR + stiffness * np.polyval(design.S, p))))


def _stiffness(nominal: StudyRecord, stiffer: StudyRecord) -> str:
    frozen, adaptive = (growth(nominal, stiffer, name) for name in ("frozen", "adaptive"))
    soft, stiff = (frozen_sensitivity(study) for study in (nominal, stiffer))
    verdict = (
        "**The frozen controller passes the stiffness test of [Z] as well as the adaptive one**, "
        "so the test shows nothing about adaptation."
        if frozen <= max(_SAME, adaptive)
        else "Here the frozen controller does lose more than the adaptive one."
    )
    return (
        f"*Stiffness.* From {nominal.scenario.stiffness:g} to {stiffer.scenario.stiffness:g} N/m "
        f"the largest force error of the frozen controller becomes {frozen:.3g} times as large on "
        f"the axis that suffers most, that of the adaptive one {adaptive:.3g} times. {verdict} "
        r"Where the loop gain is high, the error is $e \approx -(AR/S)\,x_h$: the true $K_s$ "
        f"cancels. At {_HEART_BEAT:g} Hz the frozen loop turns a millimetre of heart motion into "
        f"{soft:.3g} mN on the softer tissue, {stiff:.3g} mN on the stiffer."
    )


def _adaptation(studies: Sequence[PaperStudy]) -> str:
    shares = [
        f"{_range(adaptation_ratios(item.study))} in simulation {item.simulation.number}"
        for item in studies
    ]
    nominal = studies[0].study
    frozen, adaptive = (largest_percent(nominal, name) for name in ("frozen", "adaptive"))
    lag = lag_percent(nominal)
    cause = (
        "because most of it is the lag of the reference model behind the desired force"
        if np.all(2 * np.array(lag) > adaptive)
        else "part of which is the lag of the reference model behind the desired force"
    )
    return (
        f"*Adaptation.* Its rms distance to the reference model, $y - y_m$, is {', '.join(shares)} "
        f"times the frozen controller's. The largest force error shows little of that "
        f"({_range(adaptive)} % beside {_range(frozen)} % in simulation 1), {cause}, "
        f"{_range(lag)} %, which both controllers follow."
    )


def _model_error(parameters: StudyRecord) -> str:
    frozen, adaptive = (
        1e3 * np.abs(mean_error(parameters, name)) for name in ("frozen", "adaptive")
    )
    axis = int(np.argmax(frozen))
    name = parameters.robot.force_axes[axis]
    verdict = (
        "A wrong robot model acts like a constant force, which adaptation takes away."
        if adaptive[axis] < 0.2 * frozen[axis]
        else "Adaptation does not take it away."
    )
    return (
        f"*Robot model.* In simulation 2 the frozen controller is off by {frozen[axis]:.3g} mN on "
        f"average on the {name} axis, the adaptive one by {adaptive[axis]:.2g} mN. {verdict}"
    )


def _inverse(studies: Sequence[PaperStudy]) -> str:
    left = [
        f"{_range(largest_percent(item.study, 'adaptive_inverse'))} % in simulation "
        f"{item.simulation.number}"
        for item in studies
    ]
    return (
        "*Model inverse.* With the inverse of the reference model ahead of the loop the lag is "
        f"gone and what adaptation has gained shows in the force: {', '.join(left)}. [Z] has no "
        "such inverse."
    )


def _torques(nominal: StudyRecord, stiffer: StudyRecord) -> str:
    first, then = (largest_share(study, "adaptive") for study in (nominal, stiffer))
    limits = nominal.robot.motor_torque_limits
    late, later = (
        float(max(later_torque(study, "adaptive") / limits)) for study in (nominal, stiffer)
    )
    place = (
        "That is at the start, at rest on a moving heart; after the first "
        if then > later
        else "After the first "
    )
    reason = ", since a step of the force takes a shorter way on stiffer tissue"
    return (
        "*Torques.* [Z] reports torques that rise with the stiffness and stay within their limits. "
        "Here the largest share of a motor's limit that its controller takes goes from "
        f"{_percent(first)} to {_percent(then)}. {place}"
        f"{nominal.scenario.simulation.settling:g} s it goes from {_percent(late)} to "
        f"{_percent(later)}{reason if later < late / _SAME else ''}."
    )


def _beside_paper(studies: Sequence[PaperStudy]) -> tuple[str, str]:
    nominal, parameters = studies[0], studies[1]
    axes = nominal.study.robot.force_axes
    ours = largest_percent(nominal.study, "adaptive")
    position = np.array(
        [metrics.max_force_error_N for metrics in nominal.study.tracking["adaptive"].values()]
    )
    micrometres = 1e6 * position / nominal.study.scenario.stiffness
    moved = largest_percent(parameters.study, "adaptive")
    stated = ", ".join(f"{axis} {paper_error(parameters.simulation, axis)}" for axis in axes)
    found = ", ".join(f"{axis} {value:.3g} %" for axis, value in zip(axes, moved, strict=True))
    change = growth(nominal.study, parameters.study, "adaptive")
    return (
        f"*Beside [Z], simulation 1.* [Z]: {paper_error(nominal.simulation, axes[0])} and "
        f"{1e6 * PAPER_POSITION_ERROR:g} µm; here {_range(ours)} % and {_range(micrometres)} µm "
        "with its controller. The model's lag in it grows with the steps of the reference, whose "
        "height is assumed, so figures of the same size are no evidence of the same run.",
        f"*Beside [Z], simulation 2.* [Z]: {stated}; here {found}, at most {change:.3g} times "
        "simulation 1. "
        + (
            "The rise that [Z] has on X is not reproduced: here the error of the robot model "
            "hardly reaches the force. Neither its robot is published nor which parameters were "
            "wrong and in which direction, so where the difference comes from cannot be told."
            if change < 1.2
            else "Neither the robot of [Z] is published nor which parameters were wrong."
        ),
    )


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _range(values: Iterable[float]) -> str:
    low, high = min(values := list(values)), max(values)
    return f"{low:.3g}" if f"{low:.3g}" == f"{high:.3g}" else f"{low:.3g} to {high:.3g}"
