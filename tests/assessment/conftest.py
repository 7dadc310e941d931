"""One scenario, its design, three certificates and a short study, shared by all tests here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrac_design.assessment.choices import load_choices
from mrac_design.assessment.designs import (
    CertifiedDesign,
    _gap,
    continuous_design,
    sampled_design,
)
from mrac_design.controller.axis_loop import axis_loop
from mrac_design.simulation.scenario import load_scenario
from mrac_design.stability import certify, relative_box, sampling
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


@pytest.fixture(scope="session")
def resonant(scenario):
    """A controller with a model of the heart's band, at 1 kHz; only some of its gains may move,
    so that the proof takes seconds."""
    observer = np.polymul([1.0, 2 * 0.3 * 76.0, 76.0**2], [1.0, 120.0])
    choice = replace(
        scenario.design,
        bandwidth=550.0,
        damping=1.7,
        observer=tuple(observer.tolist()),
        internal_model=(1.0, 0.0, 41.0**2),
    )
    chosen = replace(scenario, design=choice)
    design = scenario_design(chosen)
    timing = sampling("1/1000", 1)
    loop = axis_loop(design, [timing.period])
    box = relative_box(loop, ("0.02", "0", "0.02", "0", "0"), (800, 1000))
    certificate = certify(loop, box, timing)
    return CertifiedDesign(
        title="resonant",
        scenario=chosen,
        design=design,
        certificate=certificate,
        share=0.02,
        gap=_gap(chosen, design, certificate),
    )


def shortened(scenario):
    return replace(scenario, simulation=replace(scenario.simulation, duration=5.0))


@pytest.fixture(scope="session")
def study(scenario):
    return run_study(shortened(scenario))
