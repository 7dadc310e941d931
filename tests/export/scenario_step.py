"""The sampled robot controller of a scenario: what there is to export."""

from __future__ import annotations

from dataclasses import replace

from mrac_design.controller.adaptive import build_step
from mrac_design.controller.linearisation import build_linearisation
from mrac_design.controller.robot_step import RobotStep, build_robot_step
from mrac_design.design import RSTDesign
from mrac_design.robot import build_dynamics, load_robot
from mrac_design.simulation.scenario import Scenario
from mrac_design.study import Variant, variant_controller
from mrac_design.time_domain import Discrete


def scenario_robot_step(
    scenario: Scenario, design: RSTDesign, variant: Variant, *, period: float
) -> RobotStep:
    """Every force axis of `scenario` under `variant`, sampled every `period` s.

    The model inside is the scenario's, model error included. Raises the package's errors for
    whatever in the scenario cannot be.
    """
    domain = Discrete(period)
    dynamics = build_dynamics(load_robot(scenario.robot))
    linearisation = build_linearisation(
        dynamics,
        velocity_gain=scenario.design.velocity_gain,
        tool_axis_bandwidth=scenario.design.tool_axis_bandwidth,
        model_error=scenario.model_error,
    )
    controller = replace(variant_controller(scenario, design, variant), time_domain=domain)
    axes = len(dynamics.description.force_axes)
    return build_robot_step(
        dynamics, linearisation, [build_step(controller)] * axes, time_domain=domain
    )
