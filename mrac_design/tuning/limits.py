r"""Delay margin and speed of the adaptive loop as a scenario has it: its tissue, its model error.

The controller's answer to the force does not depend on the plant, so a true stiffness Ks and a
robot that answers κ times too strongly merely replace b0/(p(p+K2)) by κ Ks/(p(p+κ K2)) in the loop
gain of `AdaptationLoop`. κ are the eigenvalues of J M⁻¹ diag(s) M̂ J⁻¹ on the force axes at home,
where M̂ is the controller's mass matrix and s the error of its rows: what the model error leaves of
the exact linearisation [Z 3].
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from flint import fmpq_poly

from mrac_design.assessment.adaptation_loop import AdaptationLoop, adaptation_speed
from mrac_design.assessment.advisor import RK4_REAL_LIMIT
from mrac_design.design import RSTDesign, stability_margins
from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import decimal_rational
from mrac_design.robot import RobotDynamics, inertial_parameters, scaled_parameters
from mrac_design.simulation.scenario import Scenario
from mrac_design.study import scenario_design
from mrac_design.time_domain import Continuous

EULER_REAL_LIMIT = 2.0
"""Largest λΔt at which an explicit Euler step, the sampled law's, damps exp(−λt)."""
_KAPPA_DIGITS = 6
"""Decimals kept of κ: exact arithmetic on all bits of a float only takes longer."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopLimits:
    """What constrains a scenario's controller, known without simulating."""

    delay_margin: float
    """Least delay margin (s) over the reference's levels, the tissue's stiffness and κ; 0 when a
    loop is unstable. In a sampled scenario delay and hold are already taken off."""
    speed_share: float
    """Fastest λΔt over the largest that the integration (the sampled law's Euler step) damps."""


def loop_limits(scenario: Scenario, strengths: tuple[float, ...]) -> LoopLimits:
    """Limits of the scenario's adaptive loop; `strengths` are the κ of `answer_strengths`.

    Linearised about each constant level of the reference, gains nominal, safeguards left out.
    """
    design, adaptation = scenario_design(scenario), scenario.adaptation
    levels = {abs(level) for steps in scenario.reference.steps for level in steps.levels}
    speeds = {
        adaptation_speed(design, adaptation, gain=adaptation.gain, force=level) for level in levels
    }
    factors = scenario.contact.stiffness_factor.levels
    stiffness = {scenario.stiffness * factor for factor in factors if factor > 0}
    margin = min(
        (
            true_delay_margin(design, speed=speed, stiffness=ks, strength=kappa)
            for speed in speeds
            for ks in stiffness
            for kappa in strengths
        ),
        default=math.inf,
    )
    return LoopLimits(
        delay_margin=max(0.0, margin - _dead_time(scenario)),
        speed_share=max(speeds) / _fastest(scenario),
    )


def true_delay_margin(
    design: RSTDesign, *, speed: float, stiffness: float, strength: float
) -> float:
    """Delay margin (s) with adaptation of `speed` λ (1/s) on tissue of `stiffness` (N/m).

    `strength` is κ, by which the linearised robot answers too strongly. 0 when already unstable.
    """
    plant = design.specification.plant
    numerator, denominator = AdaptationLoop(design=design, speed=speed).loop_gain
    kappa = decimal_rational(strength)
    gain = kappa * decimal_rational(stiffness) / decimal_rational(plant.b0)
    if kappa != 1:
        K2 = decimal_rational(plant.velocity_gain)
        denominator = denominator // fmpq_poly([K2, 1]) * fmpq_poly([kappa * K2, 1])
    try:
        return stability_margins(gain * numerator, denominator, Continuous()).delay_margin
    except ParameterError:
        return 0.0


def answer_strengths(scenario: Scenario, dynamics: RobotDynamics) -> tuple[float, ...]:
    """κ: how many times the acceleration asked for the robot gives, by principal direction."""
    robot, error = dynamics.description, scenario.model_error
    if error.body_scale == error.first_joint_scale == 1:
        return (1.0,)
    k = len(robot.force_axes)
    J = dynamics.task_jacobian(robot.home).full()
    M = dynamics.mass_matrix(robot.home, inertial_parameters(robot)).full()
    model = dynamics.mass_matrix(robot.home, scaled_parameters(robot, error.body_scale)).full()
    model[0] *= error.first_joint_scale
    answer = J @ np.linalg.solve(M, model) @ np.linalg.inv(J)
    values = np.linalg.eigvals(answer[:k, :k]).real
    return tuple(sorted({round(float(value), _KAPPA_DIGITS) for value in values}))


def _dead_time(scenario: Scenario) -> float:
    """Dead time (s) a sampled scenario has of itself: its delay and half a period of hold."""
    sampling = scenario.sampling
    if isinstance(sampling, Continuous):
        return 0.0
    return (sampling.delay + 0.5) * sampling.domain.period


def _fastest(scenario: Scenario) -> float:
    """Largest λ (1/s) that the integration, or the sampled law, still damps."""
    sampling = scenario.sampling
    if isinstance(sampling, Continuous):
        return RK4_REAL_LIMIT / scenario.simulation.step
    return EULER_REAL_LIMIT / sampling.domain.period
