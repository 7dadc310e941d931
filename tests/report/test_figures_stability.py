"""Figures of the stability report show the numbers they are given."""

from __future__ import annotations

import numpy as np
import pytest

from mrac_design.arrays import readonly
from mrac_design.assessment.prediction import Prediction
from mrac_design.assessment.worst_case import Comparison, WorstCases
from mrac_design.report.figures_stability import (
    advice_figure,
    bounds_figure,
    map_figure,
    region_figure,
)
from mrac_design.simulation.scenario import load_scenario
from mrac_design.stability import DesignMap, sampling, strictly_positive_real
from mrac_design.study import scenario_design
from mrac_design.verdict import Verdict


@pytest.fixture(scope="module")
def design():
    return scenario_design(load_scenario("nominal"))


def test_region_is_that_of_the_formula(design):
    left, right = region_figure(design).axes
    shaded = left.collections[0].get_array().reshape(57, 60)
    c, xi = np.meshgrid(np.linspace(0.05, 3.0, 60), np.linspace(0.1, 1.5, 57))
    inside = np.abs(c - 2 * xi) > 1e-9  # on the border itself the last digit decides
    np.testing.assert_array_equal(shaded[inside] == 1, (c < 2 * xi)[inside])
    # The other region against the exact verdict on the function itself, point by point.
    shaded = right.collections[0].get_array().reshape(60, 60)
    ratios, poles = np.linspace(0.05, 3.0, 60), np.linspace(0.1, 4.0, 60)
    for i, j in np.random.default_rng(0).integers(60, size=(40, 2)):
        numerator = np.polymul([1.0, ratios[i]], [1.0, ratios[i]])
        denominator = np.polymul([1.0, poles[j]], [1.0, 2.0, 1.0])
        verdict = strictly_positive_real(numerator.tolist(), denominator.tolist()).verdict
        assert (shaded[j, i] == 1) == (verdict is Verdict.PROVED)


def test_map_writes_every_cell():
    found = DesignMap(
        bandwidths=readonly([200.0, 500.0]),
        samplings=(sampling("1/1000", 1),),
        fractions=readonly([[0.25], [np.nan]]),
        stiffness_range=(800.0, 1200.0),
        resolution=0.05,
    )
    figure = map_figure(found)
    assert [text.get_text() for text in figure.axes[0].texts] == ["±25 %", "–"]
    assert "800 to 1200 N/m" in figure.caption


def test_bounds_stand_at_their_ratios():
    cases = {
        title: WorstCases(
            comparisons=(
                Comparison(name="peak", unit="N", bound=bound, simulated=1.0, trials=3),
                Comparison(name="decay", unit="s", bound=3 * bound, simulated=1.0, trials=3),
            )
        )
        for title, bound in (("first", 2.0), ("second", 4.0))
    }
    (ax,) = bounds_figure(cases).axes
    points = {line.get_label(): line.get_xdata() for line in ax.get_lines()}
    np.testing.assert_array_equal(points["first"], [2.0, 6.0])
    np.testing.assert_array_equal(points["second"], [4.0, 12.0])


def test_triangles_point_where_the_kick_went(design):
    prediction = Prediction(
        name="delay", unit="s", speed=500.0, predicted=1.46e-3, inside=1.4e-3, inside_growth=-9.0,
        outside=1.5e-3, outside_growth=9.0,
    )  # fmt: skip
    delay, _ = advice_figure(design, [prediction], 1.25).axes
    marks = {line.get_marker(): line.get_ydata()[0] for line in delay.get_lines()[1:]}
    assert marks == {"v": pytest.approx(1.4), "^": pytest.approx(1.5)}
