"""What [Z] simulates and states, and which of its simulations a scenario repeats."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from mrac_design.errors import ParameterError
from mrac_design.simulation.scenario import Scenario, load_scenario
from mrac_design.study import StudyRecord, run_study

PAPER_TORQUE_LIMIT = 150.0
"""Torque limit of every actuator in [Z] (N·m)."""

PAPER_POSITION_ERROR = 37e-6
"""Position error (m) that goes with the force error of the first simulation.

[Z] prints 3.7e-3 %; 3 % of 1 N on 800 N/m are 37 µm, so metres are taken as meant.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperSimulation:
    """One of the three simulations of [Z]."""

    number: int
    """Its number, from 1."""
    scenario: str
    """Name of the packaged scenario that repeats it."""
    condition: str
    """What is special about it, in words."""
    max_force_error_percent: Mapping[str, float]
    """Largest force error by axis in per cent, as stated in [Z]; empty where it states none."""
    qualifier: str
    """Sign before that number."""
    figures: Mapping[str, int]
    """Numbers of its figures in [Z]: `heart motion`, `force X`…, `positions`, `torques`."""

    @property
    def title(self) -> str:
        """Number and condition, as a heading."""
        return f"Simulation {self.number}: {self.condition}"


@dataclass(frozen=True, slots=True, kw_only=True)
class PaperStudy:
    """A simulation of [Z] and what came of repeating it."""

    simulation: PaperSimulation
    """The simulation."""
    study: StudyRecord
    """The runs under its conditions."""


PAPER_SIMULATIONS = (
    PaperSimulation(
        number=1,
        scenario="nominal",
        condition="perfect model",
        max_force_error_percent=dict.fromkeys("XYZ", 3.0),
        qualifier="≈ ",
        figures={
            "heart motion": 5,
            "force X": 6,
            "force Y": 7,
            "force Z": 8,
            "positions": 9,
            "torques": 10,
        },
    ),
    PaperSimulation(
        number=2,
        scenario="parameters",
        condition="wrong robot model",
        max_force_error_percent={"X": 5.3, "Y": 2.0, "Z": 2.0},
        qualifier="",
        figures={"positions": 11},
    ),
    PaperSimulation(
        number=3,
        scenario="stiffness",
        condition="stiffer tissue",
        max_force_error_percent={},
        qualifier="",
        figures={"positions": 12, "torques": 13},
    ),
)
"""The simulations of [Z], in its order."""


def paper_scenarios() -> tuple[Scenario, ...]:
    """The packaged scenarios of the simulations of [Z], in its order."""
    return tuple(load_scenario(simulation.scenario) for simulation in PAPER_SIMULATIONS)


def run_paper(scenarios: Sequence[Scenario]) -> tuple[PaperStudy, ...]:
    """Run the three scenarios, given in the order of `PAPER_SIMULATIONS`.

    Raises ParameterError when one has not the conditions of its simulation, and what `run_study`
    raises.
    """
    check_paper_conditions(scenarios)
    return tuple(
        PaperStudy(simulation=simulation, study=run_study(scenario))
        for simulation, scenario in zip(PAPER_SIMULATIONS, scenarios, strict=True)
    )


def check_paper_conditions(scenarios: Sequence[Scenario]) -> None:
    """Raise ParameterError when a scenario has not the conditions of its simulation of [Z]."""
    for simulation, scenario in zip(PAPER_SIMULATIONS, scenarios, strict=True):
        if paper_simulation(scenario) is not simulation:
            raise ParameterError(
                "scenario",
                scenario.name,
                f"has not the conditions of simulation {simulation.number} of [Z]; robot, motion, "
                "force reference, K2, ao and the adaptation gain may differ, nothing else",
            )


def paper_simulation(scenario: Scenario) -> PaperSimulation | None:
    """The simulation of [Z] that has this scenario's conditions, None when no one has.

    What [Z] states counts, not the scenario's name; what it leaves open (robot, motion, force
    reference, velocity gain, observer, adaptation gain) may be anything.
    """
    conditions = _conditions(scenario)
    for simulation in PAPER_SIMULATIONS:
        if conditions == _packaged_conditions(simulation.scenario):
            return simulation
    return None


def paper_figure(study: StudyRecord, key: str) -> str:
    """ " ([Z] figure 9)" for a picture that [Z] has too, "" for any other.

    `key` is one of the keys of `PaperSimulation.figures`.
    """
    simulation = paper_simulation(study.scenario)
    number = None if simulation is None else simulation.figures.get(key)
    return "" if number is None else f" ([Z] figure {number})"


def paper_error(simulation: PaperSimulation | None, axis: str) -> str:
    """Largest force error that `simulation` of [Z] states for an axis, with %; "–" for none."""
    if simulation is None or axis not in simulation.max_force_error_percent:
        return "–"
    # Spaces that do not break, for the sake of narrow columns.
    stated = f"{simulation.qualifier}{simulation.max_force_error_percent[axis]:g} %"
    return stated.replace(" ", "\N{NO-BREAK SPACE}")


@cache
def _packaged_conditions(name: str) -> tuple[Any, ...]:
    return _conditions(load_scenario(name))


def _conditions(scenario: Scenario) -> tuple[Any, ...]:
    design = scenario.design
    return (
        scenario.stiffness,
        scenario.contact,
        scenario.friction.scale,
        scenario.sampling,
        (design.stiffness, design.bandwidth, design.damping),
        scenario.prefilter,
        scenario.model_error,
        scenario.adaptation.bias_force,
        scenario.adaptation.safeguards,
    )
