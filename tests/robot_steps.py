"""Sampled controllers of the packaged robots, built once per choice."""

from __future__ import annotations

from functools import cache

from mrac_design.controller.adaptation import NormalisedGradientLaw
from mrac_design.controller.adaptive import AdaptiveRST, build_step, nominal_gains
from mrac_design.controller.linearisation import (
    Linearisation,
    RobotModelError,
    build_linearisation,
)
from mrac_design.controller.reference import ModelInverse
from mrac_design.controller.robot_step import RobotStep, build_robot_step
from mrac_design.controller.step import ControllerStep
from mrac_design.design import ReferenceModel, RSTSpecification, design_rst, first_order_observer
from mrac_design.plant import ForcePlant
from mrac_design.robot import RobotDynamics, build_dynamics, load_robot
from mrac_design.time_domain import Discrete, TimeDomain

STIFFNESS = 800.0
VELOCITY_GAIN = 50.0
EXACT = RobotModelError(body_scale=1.0, first_joint_scale=1.0)


@cache
def dynamics_of(robot: str) -> RobotDynamics:
    return build_dynamics(load_robot(robot))


@cache
def controller_of(domain: TimeDomain, *, bandwidth: float = 300.0) -> ControllerStep:
    design = design_rst(
        RSTSpecification(
            plant=ForcePlant(stiffness=STIFFNESS, velocity_gain=VELOCITY_GAIN),
            reference_model=ReferenceModel(bandwidth=bandwidth, damping=1.0),
            observer=first_order_observer(bandwidth),
        )
    )
    return build_step(
        AdaptiveRST(
            design=design,
            prefilter=ReferenceModel(bandwidth=50.0, damping=1.0),
            law=NormalisedGradientLaw(gain=1.0, alpha=0.1),
            feedforward=ModelInverse(),
            bias_force=0.5,
            initial_gains=nominal_gains(design),
            time_domain=domain,
        )
    )


@cache
def linearisation_of(robot: str, model_error: RobotModelError = EXACT) -> Linearisation:
    return build_linearisation(
        dynamics_of(robot),
        velocity_gain=VELOCITY_GAIN,
        tool_axis_bandwidth=50.0,
        model_error=model_error,
    )


@cache
def robot_step(
    robot: str, *, period: float = 1e-3, model_error: RobotModelError = EXACT
) -> RobotStep:
    dynamics, domain = dynamics_of(robot), Discrete(period)
    axes = len(dynamics.description.force_axes)
    return build_robot_step(
        dynamics,
        linearisation_of(robot, model_error),
        [controller_of(domain)] * axes,
        time_domain=domain,
    )
