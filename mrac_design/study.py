"""A study from scenario to record: composition only, every step is a function of its own."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mrac_design.controller.adaptive import AdaptiveRST, build_step, nominal_gains
from mrac_design.controller.linearisation import (
    Linearisation,
    build_linearisation,
    home_task_position,
)
from mrac_design.controller.reference import DirectReference, ModelInverse, ReferenceFeedforward
from mrac_design.controller.step import ControllerStep
from mrac_design.design import RSTDesign, design_rst
from mrac_design.errors import ScenarioFileError
from mrac_design.metrics.tracking import TrackingMetrics, max_torque, tracking_metrics
from mrac_design.motion import HeartMotion, load_motion, names_model, read_recorded_motion
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.plant import ForcePlant
from mrac_design.robot import RobotDescription, RobotDynamics, build_dynamics, load_robot
from mrac_design.robot.posture import check_posture, condition_numbers
from mrac_design.simulation.run import Progress
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.scenario_inputs import scenario_inputs
from mrac_design.simulation.scenario_run import ready_loop, simulate_side_by_side
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
    robot = scenario_robot(scenario)
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
    robot = scenario_robot(scenario)
    scenario_motion(scenario)
    scenario_design(scenario)
    check_posture(build_dynamics(robot), robot.home, scenario.simulation.condition_limit)


def scenario_robot(scenario: Scenario) -> RobotDescription:
    """The scenario's robot.

    Raises ScenarioFileError when the force reference has other axes than the robot.
    """
    robot = load_robot(scenario.robot)
    wanted, given = len(robot.force_axes), len(scenario.reference.steps)
    if wanted != given:
        raise ScenarioFileError(
            scenario.name,
            "reference",
            f"{given} axes given, but {robot.name} controls force on {', '.join(robot.force_axes)}",
        )
    return robot


def scenario_motion(scenario: Scenario) -> HeartMotion:
    """The scenario's heart motion, long enough for its run."""
    choice = scenario.motion
    if names_model(choice.source):
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


def variant_step(scenario: Scenario, design: RSTDesign, variant: Variant) -> ControllerStep:
    """The axis controller of a variant in the scenario's time domain."""
    controller = variant_controller(scenario, design, variant)
    return build_step(replace(controller, time_domain=controller_domain(scenario)))


def scenario_linearisation(scenario: Scenario, dynamics: RobotDynamics) -> Linearisation:
    """The scenario's linearising torque, with its model error."""
    return build_linearisation(
        dynamics,
        velocity_gain=scenario.design.velocity_gain,
        tool_axis_bandwidth=scenario.design.tool_axis_bandwidth,
        model_error=scenario.model_error,
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
    linearisation = scenario_linearisation(scenario, dynamics)
    inputs = exogenous_inputs(scenario, dynamics, motion)
    loops = [
        ready_loop(scenario, dynamics, linearisation, variant_step(scenario, design, variant))
        for variant in variants
    ]
    runs = simulate_side_by_side(scenario, loops, inputs, progress=progress)
    return dict(zip((variant.name for variant in variants), runs, strict=True))


def controller_domain(scenario: Scenario) -> TimeDomain:
    """The time domain the scenario's controller runs in."""
    sampling = scenario.sampling
    return sampling if isinstance(sampling, Continuous) else sampling.domain


def exogenous_inputs(
    scenario: Scenario, dynamics: RobotDynamics, motion: HeartMotion
) -> PiecewisePolynomial:
    """Inputs of the scenario's loop on its robot, see `scenario_inputs`."""
    axes = dynamics.description.task.position
    tip = home_task_position(dynamics)[: len(axes)]
    return scenario_inputs(scenario, motion, axes=axes, tip=tip)


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
