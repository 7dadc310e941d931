"""Scenarios ready to be run again and again: robot, inputs and compiled loop are made once."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from mrac_design.errors import SimulationError
from mrac_design.metrics.tracking import max_torque, tracking_metrics
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.robot import RobotDynamics, build_dynamics
from mrac_design.simulation.engine import Engine
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.scenario_run import ready_loop, simulate
from mrac_design.study import (
    VARIANTS,
    exogenous_inputs,
    scenario_design,
    scenario_linearisation,
    scenario_motion,
    scenario_robot,
    variant_step,
)
from mrac_design.tuning.limits import LoopLimits, answer_strengths, loop_limits
from mrac_design.tuning.variables import Variable, placed

TUNED_VARIANT = next(variant for variant in VARIANTS if variant.name == "adaptive_inverse")
"""The controller that is tuned: the others lag behind Fd by the reference model."""
LOST = 100.0
"""Error (%) that stands for a run that was not made or left the finite numbers."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseResult:
    """One scenario with one choice of the variables."""

    scenario: str
    """Name of the scenario."""
    errors: Mapping[str, float]
    """max |y − Fd| in percent of max |Fd| by axis; inf where the run was lost or not made."""
    torques: Mapping[str, float]
    """Largest motor torque (N·m) by motor; empty where the run was lost or not made."""
    torque_share: float
    """Largest torque over its motor's limit; inf where the run was lost or not made."""
    limits: LoopLimits
    """Delay margin and speed of the adaptation."""
    lost: str = ""
    """Why the run was lost or not made; empty when it was made."""

    @property
    def worst(self) -> float:
        """Error of the worst axis (%)."""
        return max(self.errors.values())


@dataclass(slots=True, kw_only=True, eq=False)
class Case:
    """One scenario on its motion, with the engine its runs share."""

    scenario: Scenario
    """The scenario as given."""
    dynamics: RobotDynamics
    """Its robot."""
    inputs: PiecewisePolynomial
    """What enters its loop; no variable changes it."""
    strengths: tuple[float, ...]
    """κ of its model error."""
    engine: Engine | None = None
    """The compiled loop, once there is one; the variables are its parameters."""

    def limits(self, variables: Sequence[Variable], values: Sequence[float]) -> LoopLimits:
        """Limits with the variables at `values`, nothing simulated."""
        return loop_limits(placed(self.scenario, variables, values), self.strengths)

    def result(self, variables: Sequence[Variable], values: Sequence[float]) -> CaseResult:
        """Run the scenario with the variables at `values`, unless the integration cannot."""
        chosen = placed(self.scenario, variables, values)
        limits = loop_limits(chosen, self.strengths)
        if limits.speed_share >= 1:
            return self._lost(limits, "the integration step is too long for the adaptation")
        try:
            return self._run(chosen, limits)
        except SimulationError as problem:  # unstable values are merely bad ones
            return self._lost(limits, str(problem))

    def with_scenario(self, scenario: Scenario) -> Case:
        """The same robot under another motion or another step."""
        motion = scenario_motion(scenario)
        inputs = exogenous_inputs(scenario, self.dynamics, motion)
        same = inputs.degree == self.inputs.degree
        return replace(self, scenario=scenario, inputs=inputs, engine=self.engine if same else None)

    def _lost(self, limits: LoopLimits, problem: str) -> CaseResult:
        return CaseResult(
            scenario=self.scenario.name,
            errors=dict.fromkeys(self.dynamics.description.force_axes, math.inf),
            torques={},
            torque_share=math.inf,
            limits=limits,
            lost=problem,
        )

    def _run(self, chosen: Scenario, limits: LoopLimits) -> CaseResult:
        step = variant_step(chosen, scenario_design(chosen), TUNED_VARIANT)
        ready = ready_loop(
            chosen, self.dynamics, scenario_linearisation(chosen, self.dynamics), step
        )
        trajectory, self.engine = simulate(chosen, ready, self.inputs, engine=self.engine)
        metrics = tracking_metrics(trajectory, settling=chosen.simulation.settling)
        torques = max_torque(trajectory)
        joints = self.dynamics.description.joints
        return CaseResult(
            scenario=chosen.name,
            errors={axis: m.max_force_error_percent for axis, m in metrics.items()},
            torques=torques,
            torque_share=max(torques[j.name] / j.motor_torque_limit for j in joints),
            limits=limits,
        )


def prepare_case(scenario: Scenario) -> Case:
    """The scenario ready to be run; raises the package's errors for what cannot be."""
    dynamics = build_dynamics(scenario_robot(scenario))
    return Case(
        scenario=scenario,
        dynamics=dynamics,
        inputs=exogenous_inputs(scenario, dynamics, scenario_motion(scenario)),
        strengths=answer_strengths(scenario, dynamics),
    )
