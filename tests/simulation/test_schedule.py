"""Schedules: every record, sample and breakpoint is met, and steps are as long as they may be."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.schedule import build_schedule

BREAKPOINTS = np.array([0.0, 0.04, 0.0525, 0.2])
RECORD = 1e-3


def schedule(step: float, *, sampling: float | None = None, spanning: bool = True):
    inputs = PiecewisePolynomial(breakpoints=BREAKPOINTS, coefficients=np.zeros((1, 3, 1)))
    return build_schedule(
        inputs,
        duration=0.15,
        step=step,
        record_period=RECORD,
        sampling_period=sampling,
        spanning=spanning,
    )


@pytest.mark.parametrize("step", [1.6e-3, 3e-3, 5e-3, 1.0])
@pytest.mark.parametrize("sampling", [None, 0.01])
def test_spanning_steps_are_equal_between_borders(step, sampling):
    found = schedule(step, sampling=sampling)
    begins = found.start[found.substeps > 0]
    lengths = found.length[found.substeps > 0]
    # Steps follow one another from beginning to end.
    np.testing.assert_allclose(begins + lengths, [*begins[1:], 0.15], atol=1e-15)
    assert lengths.max() <= step * (1 + 1e-6)
    borders = np.array([0.0, 0.04, 0.0525, 0.15])
    if sampling:
        borders = np.union1d(borders, np.arange(15) * sampling)
        borders = borders[np.append(True, np.diff(borders) > 1e-9)]
    for first, last in pairwise(borders):
        inside = (begins > first - 1e-9) & (begins < last - 1e-9)
        wanted = np.ceil((last - first) / step - 1e-6)
        assert inside.sum() == wanted
        np.testing.assert_allclose(lengths[inside], (last - first) / wanted, rtol=1e-9)
    # Records are where they belong, to the last bit, whatever the steps are.
    assert np.array_equal(found.start[found.records], RECORD * np.arange(150))
    assert found.updates.sum() == (15 if sampling else 0)
    assert np.array_equal(np.unique(found.segment), [0, 1, 2])
    assert np.all(np.diff(found.start) > 0)


@pytest.mark.parametrize("spanning", [True, False])
def test_steps_no_longer_than_a_record_divide_its_interval(spanning):
    found = schedule(4e-4, spanning=spanning)
    assert np.all(found.substeps >= 1)
    assert np.all(found.length / found.substeps <= 4e-4 * (1 + 1e-6))
    assert found.length.sum() == pytest.approx(0.15)
