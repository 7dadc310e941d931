"""Force references."""

from __future__ import annotations

import numpy as np
import pytest

from mrac_design.errors import ParameterError
from mrac_design.motion import ForceReference, StepSequence, constant_force, square_wave


def test_each_axis_steps_at_its_own_times() -> None:
    reference = ForceReference(
        steps=(
            square_wave(first=1.0, second=1.5, half_period=2.0, first_switch=1.0, duration=6.0),
            constant_force(-3.0),
            StepSequence(times=(0.0, 2.5), levels=(1.0, 2.0)),
        )
    )
    signal = reference.piecewise(6.0)
    np.testing.assert_array_equal(signal.breakpoints, [0.0, 1.0, 2.5, 3.0, 5.0, 6.0])
    t = [0.0, 0.999, 1.0, 2.5, 3.0, 4.9, 5.0, 6.0]
    np.testing.assert_array_equal(signal(t)[0], [1.0, 1.0, 1.5, 1.5, 1.0, 1.0, 1.5, 1.5])
    np.testing.assert_array_equal(signal(t)[1], np.full(8, -3.0))
    np.testing.assert_array_equal(signal(t)[2], [1, 1, 1, 2, 2, 2, 2, 2])
    assert reference.peak == (1.5, 3.0, 2.0)


def test_steps_after_the_end_are_left_out() -> None:
    sequence = StepSequence(times=(0.0, 1.0, 2.0), levels=(1.0, 2.0, 3.0))
    assert sequence.piecewise(2.0).segments == 2
    assert sequence.piecewise(0.5).segments == 1


def test_a_square_wave_stops_before_its_duration() -> None:
    wave = square_wave(first=0.0, second=1.0, half_period=0.1, first_switch=0.1, duration=0.3)
    assert len(wave.times) == 3
    assert square_wave(
        first=0.0, second=1.0, half_period=1.0, first_switch=9.0, duration=2.0
    ) == constant_force(0.0)


@pytest.mark.parametrize(
    ("times", "levels"),
    [
        ((), ()),
        ((0.0, 1.0), (1.0,)),
        ((0.5,), (1.0,)),
        ((0.0, 1.0, 1.0), (1.0, 2.0, 3.0)),
        ((0.0, float("nan")), (1.0, 2.0)),
        ((0.0,), (float("inf"),)),
    ],
)
def test_bad_sequences_are_refused(times: tuple[float, ...], levels: tuple[float, ...]) -> None:
    with pytest.raises(ParameterError):
        StepSequence(times=times, levels=levels)


def test_bad_numbers_are_refused() -> None:
    with pytest.raises(ParameterError):
        ForceReference(steps=())
    with pytest.raises(ParameterError, match="half_period"):
        square_wave(first=1.0, second=2.0, half_period=0.0, first_switch=1.0, duration=2.0)
    for end in (0.0, -1.0, float("nan")):
        with pytest.raises(ParameterError, match="end"):
            constant_force(1.0).piecewise(end)
