"""From a scenario and a choice to an ensemble that is ready to run."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import readonly
from mrac_design.controller.linearisation import home_task_position
from mrac_design.ensemble_study.choice import EnsembleChoice
from mrac_design.errors import ParameterError
from mrac_design.motion import find_model, names_model
from mrac_design.robot import RobotDescription, RobotDynamics, build_dynamics
from mrac_design.robot.parameters import parameter_names
from mrac_design.simulation.closed_loop import ForceLoop
from mrac_design.simulation.ensemble import Ensemble
from mrac_design.simulation.lanes import LANES
from mrac_design.simulation.reduction import tracking_reduction
from mrac_design.simulation.run import RunSettings
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.scenario_run import ReadyLoop, ready_loop
from mrac_design.simulation.scenario_spread import (
    MotionSource,
    OneMotion,
    ScenarioSpread,
    SeededMotions,
)
from mrac_design.simulation.tableau import RK4
from mrac_design.study import (
    exogenous_inputs,
    scenario_design,
    scenario_linearisation,
    scenario_motion,
    scenario_robot,
    variant_step,
)

_CHUNK_BYTES = 64e6
"""What the inputs of one chunk may take; every thread holds one chunk."""
_LARGEST_CHUNK = 512
_LARGEST_STEP = 5e-4
"""Longest integration step taken unless one is given (s)."""
_MOTION_SEEDS = 32
"""Different motions taken unless a number is given."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PreparedEnsemble:
    """An ensemble of a scenario, ready to run."""

    scenario: Scenario
    """The nominal choices."""
    choice: EnsembleChoice
    """How many runs and how far apart."""
    robot: RobotDescription
    """The nominal robot."""
    spread: ScenarioSpread
    """What differs between runs."""
    ensemble: Ensemble
    """The runs."""


def prepare_ensemble(scenario: Scenario, choice: EnsembleChoice) -> PreparedEnsemble:
    """The ensemble of `choice` around `scenario`, nothing of it run yet.

    Raises the package's errors for anything in either that cannot be.
    """
    robot = scenario_robot(scenario)
    dynamics = build_dynamics(robot)
    motions = _motions(scenario, choice.motion_seeds)
    duration = scenario.simulation.duration
    inputs = exogenous_inputs(scenario, dynamics, motions.motion(0, duration))
    ready = ready_loop(
        scenario,
        dynamics,
        scenario_linearisation(scenario, dynamics),
        variant_step(scenario, scenario_design(scenario), choice.controller),
    )
    spread = _spread(scenario, choice, dynamics, motions, ready)
    size = inputs.coefficients.nbytes
    chunk = int(np.clip(_CHUNK_BYTES / size, LANES, _LARGEST_CHUNK)) // LANES * LANES
    system = ready.loop.system
    ensemble = Ensemble(
        system=system,
        method=RK4,
        reduction=tracking_reduction(system.outputs, settling=scenario.simulation.settling),
        sampler=spread,
        settings=RunSettings(
            duration=duration,
            step=choice.step or _step(scenario),
            record_period=scenario.simulation.record_period,
        ),
        input_powers=inputs.degree + 1,
        runs=choice.runs,
        seed=choice.seed,
        chunk=chunk,
    )
    return PreparedEnsemble(
        scenario=scenario, choice=choice, robot=robot, spread=spread, ensemble=ensemble
    )


def _motions(scenario: Scenario, seeds: int | None) -> MotionSource:
    source = scenario.motion.source
    if names_model(source):
        return SeededMotions(model=find_model(source), count=seeds or _MOTION_SEEDS)
    if seeds not in (None, 1):
        raise ParameterError("motion seeds", seeds, f"{source} is a recording, which has no seeds")
    return OneMotion(recorded=scenario_motion(scenario))


def _spread(
    scenario: Scenario,
    choice: EnsembleChoice,
    dynamics: RobotDynamics,
    motions: MotionSource,
    ready: ReadyLoop,
) -> ScenarioSpread:
    robot, gain = dynamics.description, scenario.adaptation.gain
    slices = ready.loop.system.parameters.slices
    adapts = choice.controller.adapts and gain > 0
    if choice.gain_range is not None and not adapts:
        raise ParameterError("gain range", choice.gain_range, "nothing adapts in this controller")
    bodies: list[list[int]] = [[] for _ in robot.joints]
    for place, name in enumerate(parameter_names(robot), slices["inertia"].start):
        bodies[int(re.sub(r"\D", "", name)) - 1].append(place)
    stiffness = slices["stiffness"]
    return ScenarioSpread(
        scenario=scenario,
        motions=motions,
        axes=tuple(robot.task.position),
        tip=readonly(home_task_position(dynamics)[: len(robot.force_axes)]),
        parameters=ready.loop.parameter_values,
        initial_state=ready.state,
        held=ready.held,
        stiffness_places=tuple(range(stiffness.start, stiffness.stop)),
        body_places=tuple(tuple(places) for places in bodies),
        gain_places=_gain_places(ready.loop) if adapts else (),
        stiffness_range=choice.stiffness_range
        or (0.6 * scenario.stiffness, 1.5 * scenario.stiffness),
        gain_range=choice.gain_range or ((0.5 * gain, 2.0 * gain) if adapts else (1.0, 1.0)),
        inertia_spread=choice.inertia_spread,
    )


def _gain_places(loop: ForceLoop) -> tuple[int, ...]:
    """Where γ̂ stands; the controllers' parameters follow each other axis by axis."""
    slices = loop.system.parameters.slices
    first = f"controller_{loop.dynamics.description.force_axes[0]}"
    if first in slices:
        start = slices[first].start
    else:  # a sampled loop keeps them in one block, the linearisation's before them
        start = slices["controller"].stop - sum(c.parameters.size for c in loop.controllers)
    places: list[int] = []
    for controller in loop.controllers:
        own = controller.parameters.slices["adaptation_gain"]
        places.extend(range(start + own.start, start + own.stop))
        start += controller.parameters.size
    return tuple(places)


def _step(scenario: Scenario) -> float:
    design = scenario.design
    return min(_LARGEST_STEP, 0.25 / max(design.bandwidth, *np.abs(np.roots(design.observer))))
