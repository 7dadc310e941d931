from __future__ import annotations

import numpy as np
import pytest

from mrac_design.report import figures_study as draw
from mrac_design.report.saving import save_figures, study_figures
from mrac_design.simulation.system import Event
from mrac_design.simulation.trajectory import Occurrence
from tests.report.fakes import fake_study


@pytest.fixture(scope="module")
def study():
    return fake_study()


@pytest.mark.parametrize("name", list(study_figures(fake_study())))
def test_every_figure_has_units_a_caption_and_no_legend_over_data(study, name):
    figure = study_figures(study)[name]()
    figure.draw_without_rendering()
    assert figure.caption
    for ax in figure.axes:
        assert "(" in ax.get_ylabel(), f"{name}: no unit on {ax.get_ylabel()!r}"
        data = ax.get_window_extent()
        legends = [ax.get_legend()] if ax.get_legend() else []
        for legend in [*figure.legends, *legends]:
            # Half a pixel: a legend may touch the frame of the axes, not reach into it.
            box = legend.get_window_extent()
            assert box.y0 >= data.y1 - 0.5 or box.y1 <= data.y0 + 0.5
            assert box.x1 <= figure.bbox.x1 + 0.5


def test_force_figure_shows_the_errors_of_all_variants(study):
    _, error, model_error = draw.force_figure(study, 1).axes
    assert len(error.lines) == len(model_error.lines) == 3
    for line, trajectory in zip(error.lines, study.trajectories.values(), strict=True):
        expected = 1e3 * np.abs(trajectory["force"] - trajectory["desired_force"])[:, 1].max()
        # Thinning keeps extremes exactly; the rest is the rounding of a subtraction.
        assert np.abs(line.get_ydata()).max() == pytest.approx(expected, rel=1e-12)


def test_force_figure_marks_where_contact_is_lost():
    study = fake_study()
    event = Event(name="contact Y", rising="made", falling="lost")
    study.trajectories["adaptive"].events = tuple(
        Occurrence(time=time, event=event, rises=rises)
        for time, rises in ((1.0, False), (1.2, True), (3.0, False))
    )
    x, y = (draw.force_figure(study, axis) for axis in (0, 1))
    assert len(y.axes[0].lines) == len(x.axes[0].lines) + 2
    assert [line.get_xdata()[0] for line in y.axes[0].lines[-4:-2]] == [1.0, 3.0]


def test_torque_figure_draws_a_limit_only_when_it_is_in_sight(study):
    assert [len(ax.lines) for ax in draw.torque_figure(study).axes] == [1] * 5
    study = fake_study()
    study.trajectories["adaptive"]["torque"][0, 4] = 11.0
    assert len(draw.torque_figure(study).axes[4].lines) == 2


def two_pictures(study):
    return {name: study_figures(study)[name] for name in ("errors", "gains")}


def test_pictures_replace_an_older_folder_whole(study, tmp_path):
    target = tmp_path / "new" / "figures"
    target.mkdir(parents=True)
    (target / "stale.png").touch()
    paths = save_figures(two_pictures(study), target)
    assert sorted(paths) == sorted(target.iterdir())
    assert all(path.stat().st_size > 1000 for path in paths)
    assert [path.name for path in target.parent.iterdir()] == ["figures"]


def test_failing_picture_leaves_the_older_folder(tmp_path):
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "older.png").touch()
    broken = fake_study()
    broken.trajectories = {}  # read by the second picture only
    with pytest.raises(KeyError):
        save_figures(two_pictures(broken), tmp_path / "figures")
    assert [path.name for path in tmp_path.rglob("*")] == ["figures", "older.png"]
