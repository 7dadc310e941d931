"""Loops side by side on threads: the bits of single runs, one progress, one end."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

from mrac_design.errors import SimulationError
from mrac_design.motion import ForceReference
from mrac_design.robot import build_dynamics
from mrac_design.simulation.compilation import find_compiler
from mrac_design.simulation.scenario import load_scenario
from mrac_design.simulation.scenario_run import ready_loop, simulate, simulate_side_by_side
from mrac_design.study import (
    VARIANTS,
    exogenous_inputs,
    scenario_design,
    scenario_linearisation,
    scenario_motion,
    scenario_robot,
    variant_step,
)

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler here")


@pytest.fixture(scope="module", params=["nominal", "reality"])
def problem(request):
    """Three loops of a planar robot with six seconds of heart motion, and their inputs."""
    base = load_scenario(request.param)
    scenario = replace(
        base,
        robot="planar_2r",
        reference=ForceReference(steps=base.reference.steps[:2]),
        simulation=replace(base.simulation, duration=6.0),
    )
    dynamics = build_dynamics(scenario_robot(scenario))
    design, linearisation = scenario_design(scenario), scenario_linearisation(scenario, dynamics)
    loops = [
        ready_loop(scenario, dynamics, linearisation, variant_step(scenario, design, variant))
        for variant in VARIANTS
    ]
    return scenario, loops, exogenous_inputs(scenario, dynamics, scenario_motion(scenario))


def test_every_run_has_the_bits_it_has_alone(problem):
    scenario, loops, inputs = problem
    told: list[float] = []
    together = simulate_side_by_side(scenario, loops, inputs, progress=told.append)
    alone = [simulate(scenario, ready, inputs)[0] for ready in loops]
    for one, other in zip(together, alone, strict=True):
        for name, signal in other.signals.items():
            np.testing.assert_array_equal(one[name], signal.values)
    assert not np.array_equal(together[0]["force"], together[1]["force"])
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert len(told) >= len(loops)


def test_a_run_that_fails_ends_all_with_its_own_words(problem):
    scenario, loops, inputs = problem
    broken = replace(loops[1], state=np.full(loops[1].state.size, np.nan))
    threads = threading.active_count()
    with pytest.raises(SimulationError, match="finite"):
        simulate_side_by_side(scenario, [loops[0], broken, loops[2]], inputs)
    assert threading.active_count() == threads


def test_progress_may_cancel(problem):
    scenario, loops, inputs = problem
    told: list[float] = []

    def stop(fraction: float) -> None:
        told.append(fraction)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate_side_by_side(scenario, loops, inputs, progress=stop)
    # One that is refused in each run that was under way; nothing after that.
    assert len(told) <= len(loops)
