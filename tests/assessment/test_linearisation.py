"""The certificate speaks of the code that runs: its matrices are the code's derivatives."""

from __future__ import annotations

import pytest

from mrac_design.assessment.advisor import axis_controller
from mrac_design.assessment.linearisation import certificate_gap, linearise_axis
from mrac_design.controller.adaptive import build_step
from mrac_design.errors import ParameterError
from mrac_design.simulation.single_axis import build_sampled_axis_loop


def loop_of(item, *, velocity_gain=50.0, period=1e-3, delay=1):
    step = build_step(axis_controller(item.scenario, item.design, gain=1.0, sampling_period=period))
    return build_sampled_axis_loop(
        step, velocity_gain=velocity_gain, stiffness=800.0, period=period, delay=delay
    )


def test_matrices_agree_to_rounding(continuous, sampled, resonant):
    # A dozen products of rounded numbers.
    assert continuous.gap < 1e-14
    assert sampled.gap < 1e-14
    # The internal model's terms nearly cancel.
    assert resonant.gap < 1e-13


@pytest.mark.parametrize("wrong", [{"velocity_gain": 51.0}, {"period": 1.01e-3}])
def test_another_loop_is_noticed(sampled, wrong):
    assert certificate_gap(sampled.certificate, loop_of(sampled, **wrong)) > 1e-5


def test_another_delay_is_noticed(sampled):
    assert certificate_gap(sampled.certificate, loop_of(sampled, delay=2)) > 1e-3


def test_gains_must_fit(sampled):
    with pytest.raises(ParameterError, match="gains"):
        linearise_axis(loop_of(sampled), force=0.0, gains=[1.0, 2.0])
