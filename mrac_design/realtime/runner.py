"""Runs a scenario's controller in real time, rate by rate, and compares it with the simulation."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from mrac_design.errors import ParameterError
from mrac_design.export.c_expressions import DOUBLE, RealType
from mrac_design.export.c_package import export_c_package
from mrac_design.export.gain_document import document_of
from mrac_design.export.gain_set import GainSet, gain_set
from mrac_design.realtime.exchange import run_program
from mrac_design.realtime.experiment import (
    RealtimeExperiment,
    build_experiment,
    simulated_torque,
)
from mrac_design.realtime.machine import this_machine
from mrac_design.realtime.program import (
    SimulatedRobot,
    build_program,
    build_robot,
    require_compiler,
)
from mrac_design.realtime.record import RealtimeReport, RealtimeRun, torque_agreement
from mrac_design.robot import build_dynamics, load_robot
from mrac_design.simulation.scenario import Scenario
from mrac_design.study import VARIANTS, Variant, scenario_design

Progress = Callable[[str, float], None]
"""Called with what is being done and the finished fraction, 0 to 1."""


def run_realtime(
    scenario: Scenario,
    *,
    rates: Sequence[float],
    delay: int | None = None,
    variant: Variant = VARIANTS[-1],
    number: RealType = DOUBLE,
    progress: Progress | None = None,
) -> RealtimeReport:
    """Run the exported controller of `scenario` on the clock at each of `rates` (Hz).

    Between the wake-ups the simulated robot moves on by one period, however late the wake-up was:
    torques do not depend on the machine's latencies and are compared with the simulation's.
    `delay` is in whole samples; None is the scenario's own, and 1 for a continuous one.
    Raises RealtimeError without Linux or compiler or when the program fails, CompilationError
    when the compiler refuses, SimulationError when the loop is unstable at a rate.
    """
    compiler = require_compiler()
    gains = gain_set(scenario, scenario_design(scenario), variant)
    dynamics = build_dynamics(load_robot(scenario.robot))
    machine = this_machine()
    if not rates:
        raise ParameterError("rates", "none", "name at least one sampling rate in Hz")
    tell = progress or (lambda message, fraction: None)
    # The robot is the same at every rate; only the controllers differ.
    robot: SimulatedRobot | None = None
    runs = []
    for done, rate in enumerate(rates):
        tell(f"{rate:g} Hz: building", done / len(rates))
        experiment = build_experiment(scenario, gains, dynamics, rate=rate, delay=delay)
        robot = robot or build_robot(experiment, compiler)
        tell(f"{rate:g} Hz: running", (done + 0.5) / len(rates))
        runs.append(_run_at(rate, experiment, gains, robot, number))
    return RealtimeReport(
        scenario=scenario.name,
        robot=dynamics.description.name,
        controller=variant.name,
        real=number.name,
        delay=experiment.delay,
        duration=scenario.simulation.duration,
        machine=machine,
        runs=tuple(runs),
    )


def _run_at(
    rate: float,
    experiment: RealtimeExperiment,
    gains: GainSet,
    robot: SimulatedRobot,
    number: RealType,
) -> RealtimeRun:
    expected = simulated_torque(experiment)
    with tempfile.TemporaryDirectory(prefix="mrac-realtime-") as scratch:
        folder = Path(scratch)
        package = export_c_package(
            experiment.step,
            folder / "controller",
            number=number,
            gains_hash=document_of(gains)["hash"],
            title=f"Adaptive force controller, {gains.scenario}",
        )
        program = build_program(experiment, robot, package.directory, folder)
        record = run_program(program, experiment)
    return RealtimeRun(
        rate=rate,
        record=record,
        agreement=torque_agreement(
            record.torque,
            expected,
            limits=experiment.step.robot.effort_limits,
            period=record.period,
        ),
        costs=package.costs,
    )
