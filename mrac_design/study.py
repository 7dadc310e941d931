"""A study from scenario to record: composition only, every step is a function of its own."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrac_design.arrays import readonly
from mrac_design.controller.adaptive import AdaptiveRST, build_step, nominal_gains
from mrac_design.controller.linearisation import build_linearisation, home_task_position
from mrac_design.controller.reference import DirectReference, ModelInverse, ReferenceFeedforward
from mrac_design.design import RSTDesign, design_rst
from mrac_design.errors import ScenarioFileError
from mrac_design.metrics.tracking import TrackingMetrics, max_torque, tracking_metrics
from mrac_design.motion import HeartMotion, available_motions, load_motion, read_recorded_motion
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.plant import ForcePlant
from mrac_design.robot import RobotDescription, RobotDynamics, build_dynamics, load_robot
from mrac_design.robot.posture import check_posture, condition_numbers
from mrac_design.simulation.engine import Engine
from mrac_design.simulation.run import Progress
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.scenario_run import ready_loop, scenario_inputs, simulate
from mrac_design.simulation.trajectory import Trajectory
from mrac_design.time_domain import Continuous, TimeDomain

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Variant:
    """One of the controllers a study compares; all share design and linearisation."""

    name: str
    """Key in tables and files."""
    title: str
    """Name for people."""
    adapts: bool
    """Whether the gains move."""
    feedforward: ReferenceFeedforward
    """What enters the loop as u_c."""


VARIANTS = (
    Variant("frozen", "frozen RST", False, DirectReference()),
    Variant("adaptive", "adaptive", True, DirectReference()),
    Variant("adaptive_inverse", "adaptive + model inverse", True, ModelInverse()),
)
"""The frozen controller comes first: whatever adaptation buys is bought beyond it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyRecord:
    """Everything a report, an export or a reader needs of a study."""

    scenario: Scenario
    """The choices."""
    robot: RobotDescription
    """The true robot."""
    motion: HeartMotion
    """The heart motion."""
    plant: ForcePlant
    """What the controller is designed for."""
    design: RSTDesign
    """The RST design."""
    trajectories: Mapping[str, Trajectory]
    """Simulated runs by variant."""
    tracking: Mapping[str, Mapping[str, TrackingMetrics]]
    """Force tracking by variant and axis."""
    max_torque: Mapping[str, Mapping[str, float]]
    """Largest torque by variant and motor (N·m)."""
    worst_condition: float
    """Largest condition number of the task Jacobian met in any run."""


def run_study(scenario: Scenario, progress: Progress | None = None) -> StudyRecord:
    """Design, simulate and judge every variant of `scenario`.

    Raises the package's errors for anything in the scenario that cannot be.
    """
    robot = load_robot(scenario.robot)
    _check_axes(scenario, robot)
    motion = scenario_motion(scenario)
    design = scenario_design(scenario)
    dynamics = build_dynamics(robot)
    trajectories = simulate_variants(
        scenario, dynamics, design, motion, variants=VARIANTS, progress=progress
    )
    settling = scenario.simulation.settling
    return StudyRecord(
        scenario=scenario,
        robot=robot,
        motion=motion,
        plant=design.specification.plant,
        design=design,
        trajectories=trajectories,
        tracking={
            name: tracking_metrics(run_, settling=settling) for name, run_ in trajectories.items()
        },
        max_torque={name: max_torque(run_) for name, run_ in trajectories.items()},
        worst_condition=_worst_condition(scenario, dynamics, trajectories),
    )


def check_scenario(scenario: Scenario) -> None:
    """Raise what `run_study` would raise for the scenario's files and numbers, without running."""
    robot = load_robot(scenario.robot)
    _check_axes(scenario, robot)
    scenario_motion(scenario)
    scenario_design(scenario)
    check_posture(build_dynamics(robot), robot.home, scenario.simulation.condition_limit)


def scenario_motion(scenario: Scenario) -> HeartMotion:
    """The scenario's heart motion, long enough for its run."""
    choice = scenario.motion
    if choice.source in available_motions() or Path(choice.source).suffix == ".toml":
        return load_motion(choice.source, duration=scenario.simulation.duration)
    return read_recorded_motion(
        choice.source,
        point=choice.point,
        frame_rate=choice.frame_rate,
        cutoff=choice.cutoff,
        duration=scenario.simulation.duration,
    )


def scenario_design(scenario: Scenario) -> RSTDesign:
    """The scenario's RST design."""
    return design_rst(scenario.design.specification)


def variant_controller(scenario: Scenario, design: RSTDesign, variant: Variant) -> AdaptiveRST:
    """The axis controller of a variant in continuous time, the same on every force axis."""
    gain = scenario.adaptation.gain if variant.adapts else 0.0
    nominal = nominal_gains(design)
    return AdaptiveRST(
        design=design,
        prefilter=scenario.prefilter,
        law=scenario.adaptation.build(gain, nominal=nominal),
        feedforward=variant.feedforward,
        bias_force=scenario.adaptation.bias_force,
        initial_gains=nominal,
        time_domain=Continuous(),
    )


def simulate_variants(
    scenario: Scenario,
    dynamics: RobotDynamics,
    design: RSTDesign,
    motion: HeartMotion,
    *,
    variants: Sequence[Variant],
    progress: Progress | None = None,
) -> Mapping[str, Trajectory]:
    """Run every variant from rest on the heart; one engine serves all, parameters differ."""
    linearisation = build_linearisation(
        dynamics,
        velocity_gain=scenario.design.velocity_gain,
        tool_axis_bandwidth=scenario.design.tool_axis_bandwidth,
        model_error=scenario.model_error,
    )
    inputs = exogenous_inputs(scenario, dynamics, motion)
    axes = len(dynamics.description.force_axes)
    engine: Engine | None = None
    trajectories = {}
    for number, variant in enumerate(variants):
        controller = variant_controller(scenario, design, variant)
        ready = ready_loop(
            scenario,
            dynamics,
            linearisation,
            build_step(replace(controller, time_domain=controller_domain(scenario))),
            force=readonly(inputs(0.0)[axes : 2 * axes, 0]),
        )
        share = None if progress is None else _share(progress, number, len(variants))
        trajectories[variant.name], engine = simulate(
            scenario, ready, inputs, engine=engine, progress=share
        )
    return trajectories


def controller_domain(scenario: Scenario) -> TimeDomain:
    """The time domain the scenario's controller runs in."""
    sampling = scenario.sampling
    return sampling if isinstance(sampling, Continuous) else sampling.domain


def exogenous_inputs(
    scenario: Scenario, dynamics: RobotDynamics, motion: HeartMotion
) -> PiecewisePolynomial:
    """Heart position (m), force reference (N), k channels each, and what else the loop takes.

    The heart lies where the tissue carries the first reference when the tip is at home, so the
    run starts in equilibrium but for the heart's velocity.
    """
    duration = scenario.simulation.duration
    axes = dynamics.description.task.position
    reference = scenario.reference.piecewise(duration)
    displacement = motion.displacement.restricted(0.0, duration).selected(axes)
    tip = home_task_position(dynamics)[: len(axes)]
    start = displacement(0.0)[:, 0]
    contact = scenario.contact.build(scenario.stiffness)
    rest = tip - contact.rest_depth(reference(0.0)[:, 0])
    return scenario_inputs(scenario, displacement.shifted(rest - start), reference)


def _check_axes(scenario: Scenario, robot: RobotDescription) -> None:
    wanted, given = len(robot.force_axes), len(scenario.reference.steps)
    if wanted != given:
        raise ScenarioFileError(
            scenario.name,
            "reference",
            f"{given} axes given, but {robot.name} controls force on {', '.join(robot.force_axes)}",
        )


def _worst_condition(
    scenario: Scenario, dynamics: RobotDynamics, trajectories: Mapping[str, Trajectory]
) -> float:
    # The posture moves by millimetres; a hundredth of the samples shows its condition.
    postures = np.vstack([run_["joint_position"][::100] for run_ in trajectories.values()])
    worst = float(condition_numbers(dynamics, postures).max())
    if worst > scenario.simulation.condition_limit:
        _LOG.warning(
            "the task Jacobian's condition number reached %.3g (limit %.3g): the run came near a "
            "singular posture, its linearisation is not to be trusted",
            worst,
            scenario.simulation.condition_limit,
        )
    return worst


def _share(progress: Progress, number: int, count: int) -> Progress:
    return lambda fraction: progress((number + fraction) / count)
