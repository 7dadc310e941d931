"""Hostile simulation stays below certified bounds, and would notice a bound that is too small."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mrac_design.assessment.adaptive_runs import (
    adaptive_runs,
    motion_responses,
    peak_disturbance,
    random_heart,
)
from mrac_design.assessment.worst_case import SUBSTEPS, _points, _spans, worst_cases
from mrac_design.errors import ParameterError
from tests.oracles.adaptive_axis import Axis


@pytest.fixture(scope="module", params=["continuous", "sampled"])
def item(request, continuous, sampled):
    return {"continuous": continuous, "sampled": sampled}[request.param]


@pytest.fixture(scope="module", params=["continuous", "sampled", "resonant"])
def any_item(request, continuous, sampled, resonant):
    return {"continuous": continuous, "sampled": sampled, "resonant": resonant}[request.param]


def test_no_path_exceeds_a_bound_and_some_come_close(item, record_property):
    cases = worst_cases(item.certificate, paths=16, spans=120, seed=7)
    assert not cases.exceeded
    for comparison in cases.comparisons:
        record_property(comparison.name, comparison.ratio)
        # Hostile means hostile: at this box the bounds are known to be within a factor of 2.5.
        assert 1 <= comparison.ratio < 2.5


def test_a_resonant_controller_stays_below_its_bounds(resonant, record_property):
    cases = worst_cases(resonant.certificate, paths=12, spans=400, seed=7)
    assert len(cases.comparisons) == 3
    for comparison in cases.comparisons:
        record_property(comparison.name, comparison.ratio)
        assert 1 <= comparison.ratio < 10


def test_the_law_itself_stays_below_the_peak_gain(item):
    found = adaptive_runs(
        item.certificate, item.scenario, item.design, gains=(1.0, 30.0), runs=8, seed=3
    )
    assert 1 <= found.ratio < 20


def test_a_bound_that_is_too_small_is_exceeded(item):
    peak = item.certificate.peak
    wrong = dataclasses.replace(peak, gain=peak.gain / 3)
    certificate = dataclasses.replace(item.certificate, peak=wrong)
    exceeded = worst_cases(certificate, paths=16, spans=120, seed=7).exceeded
    assert [found.name for found in exceeded] == ["peak force per peak of $d$"]


def test_a_certificate_without_proof_is_refused(item):
    nothing = dataclasses.replace(item.certificate, decay=None)
    with pytest.raises(ParameterError, match="proved"):
        worst_cases(nothing, paths=4, spans=4, seed=1)
    with pytest.raises(ParameterError, match="at least 2"):
        worst_cases(item.certificate, paths=1, spans=4, seed=1)


def test_spans_follow_the_differential_equations(any_item):
    """Random gains and disturbance against the oracle, span by span."""
    rng = np.random.default_rng(1)
    points = _points(any_item.certificate, rng)
    spans = _spans(any_item.certificate, points)
    specification = any_item.design.specification
    axis = Axis(
        K2=50.0,
        observer=specification.observer,
        internal_model=specification.internal_model,
    )
    own = 2 + 2 * axis.n
    path, d = rng.integers(len(points), size=25), rng.standard_normal((25, SUBSTEPS))
    force, state = [], np.zeros(spans.transition.shape[1])
    for point, pushed in zip(path, d, strict=True):
        force.append(spans.rows[point] @ state + spans.direct[point] @ pushed)
        state = spans.transition[point] @ state + spans.effect[point] @ pushed
    if spans.sampled:
        expected, _ = axis.sampled_run(
            points[path, :-1], points[path, -1], d, spans.duration, 1, np.zeros(own), SUBSTEPS
        )
    else:
        expected, x = [], np.zeros(own)
        for point, pushed in zip(points[path], d, strict=True):
            transition, effect = axis.continuous_step(
                point[:-1], point[-1], spans.duration / SUBSTEPS
            )
            for value in pushed:
                x = transition @ x + effect * value
                expected.append(point[-1] * x[0])
    # Both are exact up to the rounding of a hundred products.
    np.testing.assert_allclose(np.ravel(force), expected, rtol=1e-9, atol=1e-12)


def test_random_hearts_start_from_rest_and_their_peak_is_found():
    heart = random_heart(np.random.default_rng(2))
    velocity = heart.derivative()
    assert abs(velocity(0.0)[0, 0]) < 1e-3 * float(velocity.largest_magnitude()[0])
    fine = np.linspace(0, heart.end, 200_001)
    d = velocity.derivative()(fine) + 50.0 * velocity(fine)
    # The grid meets every knot; in between the acceleration is a straight line.
    assert peak_disturbance(heart, 50.0) == pytest.approx(np.abs(d).max(), rel=2e-3)


def test_recorded_like_motion_stays_below_its_bound(item, study):
    responses = motion_responses(
        item.certificate,
        item.scenario,
        item.design,
        displacement=study.motion.displacement,
        axes=("X", "Y", "Z"),
    )
    for response in responses.values():
        assert 0 < response.simulated < response.bound
        assert response.peak_disturbance > 0.5  # m/s²: a beating heart, not a still one
