"""Which numbers of a study are recorded, which assumed, which follow from others."""

from __future__ import annotations

import numpy as np

from mrac_design.motion.heart import Origin
from mrac_design.polynomials.rationals import polynomial_latex
from mrac_design.report.paper import paper_simulation
from mrac_design.report.provenance_reality import law_extras, measurement, tissue_and_friction
from mrac_design.report.tables import Quantity, Table
from mrac_design.study import StudyRecord

_FROM_PAPER = "stated in [Z]"
_READING_OF_ERROR = (
    "published",
    "5 % and 25 % as in [Z]; which parameters it means, and their sign, is assumed",
)


def scenario_provenance(study: StudyRecord) -> Table:
    """Every quantity the study depends on, with its origin and where it comes from."""
    return Table(
        caption=(
            "What is recorded, published, assumed and derived. Published values are those "
            "printed in [Z]; a value changed in the scenario counts as assumed."
        ),
        header=("quantity", "value", "origin", "where from"),
        rows=tuple(
            (q.name, q.value, q.origin, q.remark)
            for q in (
                *_setting(study),
                *tissue_and_friction(study.scenario),
                *measurement(study.scenario.sampling),
                *_controller(study),
                *_derived(study),
            )
        ),
    )


def _setting(study: StudyRecord) -> tuple[Quantity, ...]:
    scenario, motion = study.scenario, study.motion
    peaks = ", ".join(f"{peak:g}" for peak in scenario.reference.peak)
    error = scenario.model_error
    perfect = error.body_scale == error.first_joint_scale == 1
    simulation = paper_simulation(scenario)
    chosen = (Origin.ASSUMED.value, "chosen in the scenario")
    repeated = (
        chosen if simulation is None else ("published", f"simulation {simulation.number} of [Z]")
    )
    return (
        Quantity(
            "robot parameters", study.robot.name, Origin.ASSUMED.value, "D2M2's are unpublished"
        ),
        Quantity("heart motion", motion.name, motion.origin.value, "source given in this chapter"),
        *(
            Quantity("heart motion, assumption", "", Origin.ASSUMED.value, text)
            for text in motion.assumptions
        ),
        _published("true stiffness $K_s$", scenario.stiffness, "N/m", 800.0)
        if simulation is None
        else Quantity("true stiffness $K_s$", f"{scenario.stiffness:g} N/m", *repeated),
        Quantity(
            "force reference",
            f"steps up to {peaks} N",
            Origin.ASSUMED.value,
            "[Z] shows a figure, no numbers",
        ),
        Quantity(
            "controller's robot model",
            "perfect"
            if perfect
            else f"bodies × {error.body_scale:g}, first joint "
            f"× {error.body_scale * error.first_joint_scale:g} in all",
            *(repeated if perfect or simulation is None else _READING_OF_ERROR),
        ),
    )


def _controller(study: StudyRecord) -> tuple[Quantity, ...]:
    choice, prefilter = study.scenario.design, study.scenario.prefilter
    adaptation = study.scenario.adaptation
    assumed = Origin.ASSUMED.value
    return (
        _published("design stiffness $b_0$", choice.stiffness, "N/m", 800.0),
        _published(r"reference model $\omega$", choice.bandwidth, "rad/s", 500.0),
        _published(r"reference model $\xi$", choice.damping, "", 1.0),
        _published(r"pre-filter $\omega$", prefilter.bandwidth, "rad/s", 50.0),
        _published(r"pre-filter $\xi$", prefilter.damping, "", 1.0),
        Quantity("velocity gain $K_2$", f"{choice.velocity_gain:g} 1/s", assumed, "not in [Z]"),
        Quantity("observer $A_o$", _polynomial(choice.observer), assumed, "not in [Z]"),
        Quantity("internal model $D$", _polynomial(choice.internal_model), assumed, "none in [Z]"),
        Quantity(
            "tool axis bandwidth",
            f"{choice.tool_axis_bandwidth:g} rad/s",
            assumed,
            "[Z] does not say how five joints serve three axes",
        ),
        Quantity(
            "adaptation law",
            f"{adaptation.law}, $\\hat\\gamma$ = {adaptation.gain:g}, "
            f"$\\alpha$ = {adaptation.normalisation:g} N²",
            assumed,
            r"[Z] gives no $\gamma$",
        ),
        *law_extras(study.scenario.adaptation),
        Quantity(
            "start of the adaptation", "nominal gains", assumed, r"[Z] does not give $\theta(0)$"
        ),
    )


def _derived(study: StudyRecord) -> tuple[Quantity, ...]:
    derived = Origin.DERIVED.value
    return tuple(
        Quantity(f"${name[0]}_{name[1:]}$", f"{value:.6g} {unit}", derived, "Diophantine equation")
        for name, value, unit in study.design.coefficients
    )


def _polynomial(coefficients: tuple[float, ...]) -> str:
    return f"${polynomial_latex(np.array(coefficients), 'p')}$"


def _published(name: str, value: float, unit: str, published: float) -> Quantity:
    shown = f"{value:g} {unit}".strip()
    if value == published:
        return Quantity(name, shown, "published", _FROM_PAPER)
    remark = f"[Z]: {published:g} {unit}".strip()
    return Quantity(name, shown, Origin.ASSUMED.value, remark)
