from __future__ import annotations

from dataclasses import replace

import pytest

from mrac_design.motion import ForceReference, StepSequence
from mrac_design.simulation.scenario import load_scenario
from mrac_design.tuning.tuner import TuningChoice
from mrac_design.tuning.variables import read_variables


def small(name: str = "stiffness", **changes):
    """A planar robot for 0.3 s, one force step, tissue half as stiff again as designed for."""
    base = load_scenario(name)
    step = StepSequence(times=(0.0, 0.1), levels=(1.0, 1.5))
    return replace(
        base,
        robot="planar_2r",
        reference=ForceReference(steps=(step, step)),
        simulation=replace(base.simulation, duration=0.3, settling=0.05),
        **changes,
    )


def choice(*, free: str = "k2,gain", margin: float = 0.95e-3, budget: int = 25, **changes):
    """Tune the small scenario."""
    settings = {"scenarios": (small(),), "seed": 0, **changes}
    return TuningChoice(
        variables=read_variables(free), delay_margin=margin, budget=budget, **settings
    )


@pytest.fixture(scope="package")
def record():
    from mrac_design.tuning.tuner import tune

    return tune(choice())
