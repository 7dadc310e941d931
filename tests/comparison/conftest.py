"""A small comparison, made once for all tests of it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mrac_design.comparison import (
    ComparisonStore,
    comparison_specification,
    run_comparison,
)
from mrac_design.comparison.comparison import compete
from mrac_design.comparison.conditions import condition_set
from mrac_design.comparison.setting import AxisSetting
from mrac_design.design import ReferenceModel
from mrac_design.simulation.scenario import load_scenario

NAMES = ("frozen_inverse", "mrac_inverse", "observer")


@pytest.fixture(scope="session")
def setting():
    return AxisSetting(
        stiffness=800.0,
        velocity_gain=30.0,
        period=1e-3,
        delay=1,
        noise=5e-3,
        resolution=5e-3,
        prefilter=ReferenceModel(bandwidth=50.0, damping=1.0),
        extra_delay=1,
        allowed_growth=2.0,
    )


@pytest.fixture(scope="session")
def specification():
    return comparison_specification(load_scenario("reality"), budget=4, seeds=2, taking_part=NAMES)


@pytest.fixture(scope="session")
def conditions(specification):
    return condition_set(
        specification.setting, specification.motion, axis="Z", stiffness_factor=1.5
    )


@pytest.fixture(scope="session")
def short(conditions):
    """The first seconds of the training motion."""
    whole = conditions.training
    return replace(
        whole,
        heart=whole.heart.restricted(0.0, 8.0),
        reference=whole.reference.restricted(0.0, 8.0),
        settling=2.0,
    )


@pytest.fixture(scope="session")
def folder(specification, conditions, tmp_path_factory):
    """A folder whose runs/ hold every contestant, finished."""
    out = tmp_path_factory.mktemp("comparison")
    store = ComparisonStore(out / "runs")
    for contestant in specification.contestants:
        entry = compete(contestant, specification, conditions)
        store.write(contestant.name, specification.fingerprint(contestant), entry)
    return out


@pytest.fixture(scope="session")
def comparison(specification, folder):
    return run_comparison(specification, store=ComparisonStore(folder / "runs"))
