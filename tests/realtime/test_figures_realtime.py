from __future__ import annotations

from dataclasses import replace

import numpy as np

from mrac_design.report.figures_realtime import latency_figure


def test_histograms_hold_every_period(report):
    figure = latency_figure(report)
    for ax in figure.axes:
        curves = [line for line in ax.lines if line.get_drawstyle() == "steps-mid"]
        assert [line.get_label() for line in curves] == ["1000 Hz", "1300 Hz"]
        for line, run in zip(curves, report.runs, strict=True):
            assert np.nansum(line.get_ydata()) == run.record.wake.size


def test_periods_are_marked_and_the_machine_is_named(report):
    figure = latency_figure(report)
    marks = [line.get_xdata()[0] for line in figure.axes[0].lines if line.get_linestyle() == "--"]
    np.testing.assert_allclose(marks, [1000.0, 1e6 / 1300])
    assert str(report.machine) in figure.caption
    assert all("µs" in ax.get_xlabel() for ax in figure.axes)


def test_a_coarse_clock_still_draws(report):
    """A clock of milliseconds reads zero for most steps."""
    run = report.runs[0]
    record = replace(run.record, step=np.zeros(run.record.step.size))
    figure = latency_figure(replace(report, runs=(replace(run, record=record),)))
    (line,) = figure.axes[1].lines
    assert np.nansum(line.get_ydata()) == record.wake.size
