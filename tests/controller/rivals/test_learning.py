"""PI with iterative learning: the filter Q, the convergence condition, learning itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrac_design.controller.rivals.learning import (
    iterative_learning,
    learning_convergence,
    zero_phase_low_pass,
)
from mrac_design.errors import ParameterError
from tests.controller.rivals.cases import (
    DELAY,
    LEARNING,
    PERIOD,
    PLANT,
    STIFFNESS,
    VELOCITY_GAIN,
)
from tests.oracles import sampled_force_loop as loop

PHI, GAMMA = loop.plant(STIFFNESS, VELOCITY_GAIN, PERIOD)


def errors(specification, disturbance):
    rows, command = iterative_learning(specification).matrices()
    return -loop.run(
        rows, command, PHI, GAMMA, DELAY,
        disturbance=disturbance, reference=np.zeros(disturbance.size),
        state=np.zeros(rows.shape[0]), plant_state=[0, 0],
    )  # fmt: skip


def iteration_factor(specification, frequency):
    """Q (1 − L z^δ P) from the closed PI loop, worked out from the plant's matrices."""
    z = np.exp(2j * np.pi * frequency * PERIOD)
    G = np.array([1.0, 0.0]) @ np.linalg.solve(z * np.eye(2) - PHI, GAMMA) * z**-DELAY
    C = specification.proportional + specification.integral * PERIOD / (z - 1.0)
    P = G / (1.0 + G * C)
    half = specification.half_width
    Q = zero_phase_low_pass(specification) @ z ** np.arange(-half, half + 1)
    return Q * (1.0 - specification.learning * z**specification.lead * P)


def test_the_filter_has_zero_phase_and_the_cutoff_asked_for():
    taps = zero_phase_low_pass(LEARNING)
    np.testing.assert_array_equal(taps, taps[::-1])
    shift = np.arange(-LEARNING.half_width, LEARNING.half_width + 1)

    def gain(f):
        return (taps * np.cos(2 * np.pi * f * PERIOD * shift)).sum()

    assert gain(0.0) == pytest.approx(1.0)
    assert gain(LEARNING.cutoff) == pytest.approx(0.5, abs=0.02)  # the window's middle
    assert abs(gain(60.0)) < 0.01


@pytest.mark.parametrize("harmonic", [1, 2])
def test_each_period_shrinks_the_error_by_the_iteration_factor(harmonic):
    proportional = replace(LEARNING, integral=0.0)  # its transient is gone within a period
    period = LEARNING.repetition
    frequency = harmonic / (period * PERIOD)
    k = np.arange(8 * period)
    found = errors(proportional, np.sin(2 * np.pi * frequency * PERIOD * k))
    tone = np.exp(-2j * np.pi * frequency * PERIOD * np.arange(period))
    sizes = np.abs([tone @ found[i * period : (i + 1) * period] for i in range(8)])
    expected = abs(iteration_factor(proportional, frequency))
    # The first periods hold the start; a period's end meets the next one through Q's width.
    assert sizes[6] / sizes[5] == pytest.approx(expected, rel=0.1)
    assert sizes[7] < 0.2 * sizes[0]


def test_convergence_is_judged_by_the_largest_factor():
    verdict = learning_convergence(LEARNING, PLANT, delay=DELAY, points=4000)
    frequencies = np.linspace(0.2, 499.0, 3000)
    largest = max(abs(iteration_factor(LEARNING, f)) for f in frequencies)
    assert verdict.converges
    # The judge also looks closer to zero frequency, where the factor tends to one.
    assert verdict.contraction >= largest * (1 - 1e-6)


def test_what_the_condition_refuses_diverges():
    greedy = replace(LEARNING, learning=12.0)
    verdict = learning_convergence(greedy, PLANT, delay=DELAY, points=4000)
    assert not verdict.converges
    frequency = 1.0 / (LEARNING.repetition * PERIOD)
    k = np.arange(40 * LEARNING.repetition)
    found = np.abs(errors(greedy, np.sin(2 * np.pi * frequency * PERIOD * k)))
    period = LEARNING.repetition
    assert found[-period:].max() > 3.0 * found[10 * period : 11 * period].max()


def test_nothing_is_learned_of_a_motion_with_another_period():
    k = np.arange(20 * LEARNING.repetition)
    period = LEARNING.repetition
    right = errors(LEARNING, np.sin(2 * np.pi * k / period))[-period:]
    wrong = errors(LEARNING, np.sin(2 * np.pi * k / (1.5 * period)))[-period:]
    plain = errors(replace(LEARNING, learning=0.0), np.sin(2 * np.pi * k / period))[-period:]
    assert right.std() < 0.05 * plain.std()
    assert wrong.std() > 0.5 * plain.std()


def test_nonsense_is_refused():
    with pytest.raises(ParameterError, match="repetition"):
        replace(LEARNING, repetition=50)
    with pytest.raises(ParameterError, match="cut-off"):
        replace(LEARNING, cutoff=600.0)
