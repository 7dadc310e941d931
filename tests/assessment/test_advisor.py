"""The advisor's bounds: confirmed by simulation, ordered as they must be, and honest about none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from flint import fmpq

from mrac_design.arrays import readonly
from mrac_design.assessment.advisor import (
    advise_gain,
    largest_stable_speed,
    projection_box,
    with_bandwidth,
)
from mrac_design.assessment.designs import remedies
from mrac_design.assessment.prediction import (
    FAST,
    delay_prediction,
    noise_prediction,
    sampled_prediction,
    step_prediction,
)
from mrac_design.errors import ParameterError
from mrac_design.stability import DesignMap, sampling
from mrac_design.study import scenario_design

KILOHERTZ = sampling("1/1000", 1)


@pytest.mark.parametrize(("speed", "milliseconds"), [(0.0, 2.09), (FAST, 1.26)])
def test_delay_margin_is_where_the_simulation_turns(scenario, design, speed, milliseconds):
    found = delay_prediction(scenario, design, speed=speed, force=2.0, name="delay")
    assert 1e3 * found.predicted == pytest.approx(milliseconds, abs=0.005)
    assert found.confirmed
    assert found.outside / found.inside < 1.15


def test_step_limit_is_where_the_integration_turns(scenario, design, choices):
    found = step_prediction(scenario, design, choices.needs)
    assert found.confirmed
    assert found.outside_growth == math.inf


@pytest.mark.parametrize("bandwidth", [200.0, 500.0])
def test_sampled_limit_is_where_the_code_turns(scenario, choices, bandwidth):
    moved = with_bandwidth(scenario, bandwidth=bandwidth)
    found = sampled_prediction(moved, scenario_design(moved), choices.needs, KILOHERTZ)
    assert found.confirmed


def test_force_noise_is_what_a_run_shows(scenario, design, choices):
    for speed in (0.0, 1000.0):
        found = noise_prediction(scenario, design, choices.needs, speed=speed)
        # 20 s of noise of limited bandwidth, where the prediction takes a flat spectrum.
        assert found.simulated == pytest.approx(found.predicted, rel=0.1)


def test_bounds_tighten_with_what_is_asked(scenario, design, choices):
    def limits(**changes):
        needs = replace(choices.needs, **changes)
        advice = advise_gain(scenario, design, needs, sampled=None, box=None)
        return {bound.source: bound.limit for bound in advice.bounds}, advice

    easy, _ = limits()
    late, advice = limits(dead_time=1.8e-3)
    assert late["delay margin"] < easy["delay margin"]
    assert advice.binding.source == "delay margin"
    assert advice.largest_gain == late["delay margin"]
    assert limits(dead_time=1e-3)[0]["delay margin"] == math.inf
    hopeless, advice = limits(dead_time=3e-3)
    assert hopeless["delay margin"] == 0
    assert "not met even without adaptation" in advice.binding.evidence
    assert limits(integration_step=1e-3)[0]["integration step"] == pytest.approx(
        easy["integration step"] / 10
    )
    assert limits(noise_growth=1.05)[0]["sensor noise"] < easy["sensor noise"]
    assert advice.box is None
    assert math.isnan(advice.time_to_border)


def test_sampled_advice_replaces_the_step_by_the_codes_poles(sampled, choices):
    advice = advise_gain(
        sampled.scenario, sampled.design, choices.needs, sampled=KILOHERTZ,
        box=sampled.certificate.box,
    )  # fmt: skip
    assert [b.source for b in advice.bounds] == ["delay margin", "sampled loop", "sensor noise"]
    assert 0 < advice.time_to_border < math.inf
    assert "no limit" in advice._repr_markdown_()


def test_projection_box_lies_inside_the_certified_one(sampled):
    certified = sampled.certificate.box
    box = projection_box(certified)
    for k in range(3):
        low, high = (fmpq(*side[k].as_integer_ratio()) for side in (box.lower, box.upper))
        assert certified.lower[k] < low < high < certified.upper[k]
        # No more is given away than rounding needs.
        assert (certified.upper[k] - high) * 10**12 < certified.upper[k]


def test_the_first_crossing_counts():
    assert largest_stable_speed(lambda rate: rate < 40 or rate > 4000) == pytest.approx(
        40, rel=2e-3
    )
    assert largest_stable_speed(lambda rate: True) == math.inf
    assert largest_stable_speed(lambda rate: False) == 0.0


def grid(fractions):
    return DesignMap(
        bandwidths=readonly([200.0, 500.0]),
        samplings=(KILOHERTZ, sampling("1/4000", 1)),
        fractions=readonly(fractions),
        stiffness_range=(800.0, 1200.0),
        resolution=0.05,
    )


def test_remedies_come_from_the_map():
    found = grid([[0.25, 0.4], [0.1, 0.3]])
    sentences = remedies(found, bandwidth=500.0, timing=KILOHERTZ, fraction=0.2)
    assert "Lower ω from 500 to 200" in sentences[0]
    assert "4000 Hz" in sentences[1]
    assert "±10 %" in sentences[2]
    (fine,) = remedies(found, bandwidth=200.0, timing=KILOHERTZ, fraction=0.2)
    assert "as it is" in fine
    (nothing,) = remedies(
        grid(np.full((2, 2), np.nan)), bandwidth=500.0, timing=KILOHERTZ, fraction=0.2
    )
    assert "Nothing in the map" in nothing
    with pytest.raises(ParameterError, match="timing"):
        remedies(found, bandwidth=500.0, timing=sampling("1/900", 1), fraction=0.2)
