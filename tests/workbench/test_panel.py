from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from mrac_design.errors import ParameterError
from mrac_design.simulation.scenario import load_scenario
from mrac_design.workbench.view import (
    DesignValues,
    design_view,
    initial_values,
    view_figure,
)

panel_module = pytest.importorskip("mrac_design.workbench.panel", reason="needs ipywidgets")


@pytest.fixture(scope="module")
def scenario():
    return load_scenario("nominal")


@pytest.fixture(scope="module")
def start(scenario):
    return initial_values(scenario)


def test_there_is_a_slider_for_every_value(start):
    assert set(panel_module.SLIDERS) == {field.name for field in fields(DesignValues)}


def test_view_starts_from_the_scenario_and_changes_only_what_is_asked(scenario, start):
    view = design_view(start, scenario)
    specification = view.design.specification
    assert specification.plant.stiffness == scenario.design.stiffness
    assert specification.reference_model.bandwidth == scenario.design.bandwidth
    softer = design_view(replace(start, stiffness=400.0), scenario)
    assert softer.design.specification == specification
    assert softer.tracking != view.tracking


def test_zero_gain_is_the_frozen_controller(scenario, start):
    runs = design_view(replace(start, adaptation_gain=0.0), scenario).trajectories
    np.testing.assert_array_equal(runs["adaptive"]["force"], runs["frozen"]["force"])


def test_single_axis_obeys_the_closed_form_of_the_frozen_loop(scenario, start):
    """At low frequency the error is K2 r1/s1 Xh' + (K2 + r1)/s1 Xh'' with opposite sign."""
    view = design_view(replace(start, velocity_gain=100.0), scenario)
    run, design = view.trajectories["frozen"], view.design
    heart = run["heart"][:, 0]
    velocity = np.gradient(heart, run.time)
    acceleration = np.gradient(velocity, run.time)
    expected = -(100.0 * design.r1 * velocity + (100.0 + design.r1) * acceleration) / design.S[1]
    error = run["force"][:, 0] - run["model_force"][:, 0]
    kept = (run.time > 0.3) & (run.time < run.time[-1] - 0.1)
    # Terms of order (motion frequency)/ω are left out: the motion's content ends near 8 Hz.
    assert np.corrcoef(error[kept], expected[kept])[0, 1] > 0.95
    assert np.std(error[kept]) == pytest.approx(np.std(expected[kept]), rel=0.1)


def test_view_refuses_what_cannot_be(scenario, start):
    with pytest.raises(ParameterError, match="K2"):
        design_view(replace(start, velocity_gain=-1.0), scenario)


def test_picture_shows_all_variants_below_the_design(scenario, start):
    figure = view_figure(design_view(start, scenario))
    figure.draw_without_rendering()
    poles, _, force, error = figure.axes
    assert len(force.get_lines()) == 4
    assert len(error.get_lines()) == 3
    (legend,) = figure.legends
    assert legend.get_window_extent().y0 >= poles.get_window_extent().y1 - 0.5
    assert legend.get_window_extent().x1 <= figure.bbox.x1


def test_true_stiffness_moves_the_poles(scenario, start):
    def circles(stiffness):
        view = design_view(replace(start, stiffness=stiffness), scenario)
        ax = view_figure(view).axes[0]
        (line,) = [each for each in ax.get_lines() if each.get_label() == "on true $K_s$"]
        return line.get_xdata() + 1j * line.get_ydata(), view.design

    at_design, design = circles(scenario.design.stiffness)
    np.testing.assert_allclose(at_design, design.closed_loop_poles)
    elsewhere, _ = circles(2 * scenario.design.stiffness)
    A = np.array([1.0, start.velocity_gain, 0.0])
    characteristic = np.polyadd(
        np.polymul(A, design.R), 2 * scenario.design.stiffness * np.array(design.S)
    )
    # Residual of each pole against the size of the polynomial's terms there.
    size = np.polyval(np.abs(characteristic), np.abs(elsewhere))
    assert np.all(np.abs(np.polyval(characteristic, elsewhere)) < 1e-9 * size)


def test_moving_a_slider_redraws_and_reset_returns(scenario, start):
    panel = panel_module.design_panel(scenario)
    before = panel.picture.value
    panel.sliders["bandwidth"].value = 300.0
    assert panel.picture.value != before
    assert panel.values.bandwidth == 300.0
    assert panel.message.value == ""
    panel.reset.click()
    assert panel.values == start
    assert panel.picture.value == before


def test_complaint_is_shown_in_the_panel_and_goes_away(scenario):
    panel = panel_module.design_panel(scenario)
    good = panel.picture.value
    slider = panel.sliders["damping"]
    slider.min = -1.0
    slider.value = -0.5
    assert "damping" in panel.message.value
    assert "Traceback" not in panel.message.value
    assert panel.picture.value == good
    slider.value = 0.7
    assert panel.message.value == ""
