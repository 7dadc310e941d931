from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrac_design.report.style import COLOURS, new_figure, styled, thinned


@given(
    count=st.integers(1, 5000),
    points=st.integers(2, 400).map(lambda half: 2 * half),
    seed=st.integers(0, 2**32 - 1),
)
def test_thinning_keeps_ends_extremes_and_order(count, points, seed):
    values = np.random.default_rng(seed).normal(size=count)
    time = np.arange(count) * 0.5
    thin_time, thin_values = thinned(time, values, points)
    assert thin_time.size <= points + 2
    assert np.all(np.diff(thin_time) > 0)
    assert (thin_time[0], thin_time[-1]) == (time[0], time[-1])
    assert (thin_values.min(), thin_values.max()) == (values.min(), values.max())
    # Every sample kept is a sample of the line, at its own time.
    np.testing.assert_array_equal(values[(thin_time / 0.5).astype(int)], thin_values)


def test_a_single_spike_survives_thinning():
    values = np.zeros(100_000)
    values[54_321] = 1.0
    time, thin_values = thinned(np.arange(100_000.0), values, 200)
    assert time[np.argmax(thin_values)] == 54_321


def test_figure_carries_its_caption_to_the_notebook():
    figure = new_figure(2, "the caption")
    with styled():
        figure.subplots().plot([0, 1], [0, 1])
    data, metadata = figure._repr_mimebundle_()
    assert data["image/svg+xml"].lstrip().startswith("<?xml")
    assert metadata["image/svg+xml"]["caption"] == "the caption"


def test_the_same_figure_gives_the_same_bytes():
    def draw():
        figure = new_figure(2, "")
        with styled():
            figure.subplots().plot([0, 1], [0, 1])
        return figure.svg()

    assert draw() == draw()


@pytest.mark.parametrize("kind", ["frozen", "adaptive", "adaptive_inverse"])
def test_colours_of_the_controllers_differ_in_lightness_or_hue(kind):
    def rgb(name):
        return np.array([int(COLOURS[name][i : i + 2], 16) for i in (1, 3, 5)])

    for other in {"frozen", "adaptive", "adaptive_inverse", "desired"} - {kind}:
        assert np.abs(rgb(kind) - rgb(other)).max() > 60
