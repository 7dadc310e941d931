"""One scenario, its design, two certificates and a short study, shared by all tests here."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mrac_design.assessment.choices import load_choices
from mrac_design.assessment.designs import continuous_design, sampled_design
from mrac_design.simulation.scenario import load_scenario
from mrac_design.study import run_study, scenario_design


@pytest.fixture(scope="session")
def scenario():
    return load_scenario("nominal")


@pytest.fixture(scope="session")
def design(scenario):
    return scenario_design(scenario)


@pytest.fixture(scope="session")
def choices():
    # Twenty per cent is where the certificates are sharp, so that hostile simulation has teeth.
    return replace(load_choices("paper"), continuous_box=0.2)


@pytest.fixture(scope="session")
def continuous(scenario, choices):
    return continuous_design(scenario, choices)


@pytest.fixture(scope="session")
def sampled(scenario, choices):
    return sampled_design(scenario, choices)


def shortened(scenario):
    return replace(scenario, simulation=replace(scenario.simulation, duration=5.0))


@pytest.fixture(scope="session")
def study(scenario):
    return run_study(shortened(scenario))
