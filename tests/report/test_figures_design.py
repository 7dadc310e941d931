from __future__ import annotations

import math

import numpy as np
import pytest

from mrac_design.design import ReferenceModel, RSTSpecification, design_rst, first_order_observer
from mrac_design.plant import ForcePlant
from mrac_design.report.figures_design import (
    loop_figure,
    pole_figure,
    realness_figure,
    sensitivity_figure,
)
from mrac_design.report.figures_robot import home_points, posture_figure
from mrac_design.robot import available_robots, build_dynamics, load_robot
from mrac_design.stability import factorisations


@pytest.fixture(scope="module")
def design():
    return design_rst(
        RSTSpecification(
            plant=ForcePlant(stiffness=800.0, velocity_gain=50.0),
            reference_model=ReferenceModel(bandwidth=500.0, damping=0.8),
            observer=first_order_observer(400.0),
        )
    )


@pytest.fixture(scope="module")
def splittings():
    return factorisations(800, 50, filter_zero=40, bandwidth=500, damping=1).rows


def legends_are_clear(figure):
    figure.draw_without_rendering()
    boxes = [legend.get_window_extent() for legend in figure.legends]
    return all(
        box.y0 >= ax.get_window_extent().y1 - 0.5 and box.x1 <= figure.bbox.x1 + 0.5
        for ax in figure.axes
        for box in boxes
    )


@pytest.mark.parametrize("draw", [pole_figure, loop_figure, sensitivity_figure])
def test_design_figures_name_units_and_keep_legends_off_the_data(draw, design):
    figure = draw(design)
    assert legends_are_clear(figure)
    for ax in figure.axes:
        assert "(" in ax.get_ylabel()
    assert figure.caption


def test_pole_figure_shows_the_poles_of_the_design(design):
    (ax,) = pole_figure(design).axes
    drawn = {line.get_label(): line for line in ax.get_lines()}
    poles = np.sort_complex(design.closed_loop_poles)
    shown = np.sort_complex(
        drawn["closed loop"].get_xdata() + 1j * drawn["closed loop"].get_ydata()
    )
    np.testing.assert_array_equal(shown, poles)
    # The paths for a wrong stiffness start from these poles: factor 1 is among the factors.
    paths = drawn["wrong stiffness"].get_xdata() + 1j * drawn["wrong stiffness"].get_ydata()
    assert all(np.abs(paths - pole).min() < 1e-6 * abs(pole) for pole in poles)


def test_loop_figure_marks_the_phase_margin_at_crossover(design):
    margins = design.margins()
    phase = loop_figure(design).axes[1]
    bar = next(line for line in phase.get_lines() if line.get_linewidth() > 2)
    height = np.ptp(bar.get_ydata())
    # The top is read off the drawn curve by interpolation between 400 points.
    assert height == pytest.approx(math.degrees(margins.phase_margin), abs=0.1)
    assert f"{math.degrees(margins.phase_margin):.3g}°" in loop_figure(design).caption


def test_realness_figure_dashes_what_is_not_strictly_positive_real(splittings):
    figure = realness_figure(splittings, 150.0)
    assert legends_are_clear(figure)
    lines = figure.axes[0].get_lines()
    assert [line.get_linestyle() == "--" for line in lines] == [
        row.strict.verdict.value != "proved" for row in splittings
    ]
    for line, row in zip(lines, splittings, strict=True):
        inside = np.abs(line.get_ydata()).max() <= 90 + 1e-9
        assert inside == (row.positive.verdict.value == "proved")


@pytest.mark.parametrize("name", available_robots())
def test_drawn_tip_is_where_the_kinematics_put_it(name):
    robot = load_robot(name)
    tip = build_dynamics(robot).forward_kinematics(robot.home)[1].full().ravel()
    # Two orders of multiplying the same rotations: a few roundings of lengths below 1 m.
    np.testing.assert_allclose(home_points(robot)[-1], tip, atol=1e-14)
    assert legends_are_clear(posture_figure(robot))
