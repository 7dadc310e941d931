"""A planar robot on a beating heart for a tenth of a second, and its real-time program."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from mrac_design.export.c_expressions import DOUBLE
from mrac_design.export.c_package import export_c_package
from mrac_design.export.gain_set import gain_set
from mrac_design.motion import ForceReference
from mrac_design.realtime.experiment import RealtimeExperiment, build_experiment
from mrac_design.realtime.program import build_program, build_robot, require_compiler
from mrac_design.robot import build_dynamics, load_robot
from mrac_design.simulation.scenario import Scenario, load_scenario
from mrac_design.study import scenario_design

DURATION = 0.1


def small_scenario() -> Scenario:
    base = load_scenario("nominal")
    return replace(
        base,
        robot="planar_2r",
        reference=ForceReference(steps=base.reference.steps[:2]),
        simulation=replace(base.simulation, duration=DURATION, settling=0.0),
    )


def small_experiment(rate: float) -> RealtimeExperiment:
    scenario = small_scenario()
    return build_experiment(
        scenario,
        gain_set(scenario, scenario_design(scenario)),
        build_dynamics(load_robot(scenario.robot)),
        rate=rate,
        delay=None,
    )


def built_program(experiment: RealtimeExperiment, folder: Path) -> Path:
    package = export_c_package(
        experiment.step, folder / "controller", number=DOUBLE, gains_hash="ab" * 32, title="Small"
    )
    robot = build_robot(experiment, require_compiler())
    return build_program(experiment, robot, package.directory, folder)
