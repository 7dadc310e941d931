"""An ensemble of pendulums, importable by workers in other processes."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from mrac_design.simulation.ensemble import Ensemble
from mrac_design.simulation.lanes import Case
from mrac_design.simulation.reduction import Reduction
from mrac_design.simulation.run import RunSettings
from mrac_design.simulation.tableau import RK4
from tests.simulation.small_systems import INITIAL_STATE, PARAMETER_VALUES, pendulum, pushes


@dataclass(frozen=True)
class RandomPendulum:
    """Another inertia and another push for every run; two kinds of schedule."""

    def __call__(self, run: int, rng: np.random.Generator) -> Case:
        parameters = PARAMETER_VALUES * rng.uniform(0.8, 1.2, 3)
        inputs = pushes(jump=rng.uniform(-1, 1))
        if run % 5 == 0:
            inputs = inputs.restricted(0.0, 1.5)
        return Case(parameters=parameters, initial_state=INITIAL_STATE, inputs=inputs)


def largest_angle_and_energy(size: int) -> Reduction:
    a, y, now = ca.SX.sym("a", 3), ca.SX.sym("y", size), ca.SX.sym("now")
    following = ca.vertcat(
        ca.fmax(a[0], ca.fabs(y[0])), a[1] + (now >= 0.5) * y[1], a[2] + (now >= 0.5)
    )
    return Reduction(
        initial=np.zeros(3),
        fold=ca.Function("fold", [a, y, now], [following]),
        finish=ca.Function("finish", [a], [ca.vertcat(a[0], a[1] / a[2])]),
        metrics=("largest_angle", "mean_energy"),
    )


def pendulums(*, runs: int = 40, seed: int = 7, sampled: bool = False, chunk: int = 9) -> Ensemble:
    system = pendulum(sampling_period=0.005 if sampled else None)
    return Ensemble(
        system=system,
        method=RK4,
        reduction=largest_angle_and_energy(system.outputs.size),
        sampler=RandomPendulum(),
        settings=RunSettings(duration=1.5, step=0.005, record_period=0.01),
        input_powers=3,
        runs=runs,
        seed=seed,
        chunk=chunk,
    )
