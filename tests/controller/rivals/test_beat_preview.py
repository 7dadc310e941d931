"""ECG-assisted preview: the quadratic gains, the memory, beats of changing length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrac_design.controller.rivals.beat_preview import beat_preview_step, quadratic_gains
from mrac_design.controller.rivals.observation import sampled_plant
from mrac_design.errors import ParameterError
from mrac_design.motion.reference import constant_force
from mrac_design.motion.signal import PiecewisePolynomial, quintic_hermite
from mrac_design.simulation.run import RunSettings
from mrac_design.simulation.single_axis import (
    axis_inputs,
    build_sampled_axis_loop,
    simulate_axis,
)
from tests.controller.rivals.cases import (
    DELAY,
    DOMAIN,
    PERIOD,
    PLANT,
    PREVIEW,
    STIFFNESS,
    VELOCITY_GAIN,
)
from tests.oracles import sampled_force_loop as loop


def test_gains_are_those_of_the_finite_problem_solved_at_once():
    """A horizon long enough to be infinite, as one least-squares problem over all commands."""
    penalty, count, preview = 1e-3, 400, 8
    phi, gamma = loop.plant(STIFFNESS, VELOCITY_GAIN, PERIOD)
    L, f = quadratic_gains(sampled_plant(PLANT, DOMAIN, delay=0), penalty, preview)
    response = np.empty(count)
    x = np.zeros(2)
    for k in range(count):
        x = phi @ x + gamma * (k == 0)
        response[k] = x[0]
    G = np.array([[response[i - j] if i >= j else 0.0 for j in range(count)] for i in range(count)])
    stacked = np.vstack([G, np.sqrt(penalty) * np.eye(count)])

    def first_command(free):
        return np.linalg.lstsq(stacked, np.concatenate([-free, np.zeros(count)]), rcond=None)[0][0]

    for j in range(preview):  # a disturbance of one unit at the input, j samples from now
        assert first_command(G[:, j]) == pytest.approx(-f[j], rel=1e-5, abs=1e-8)
    for i in range(2):
        x, free = np.eye(2)[i], []
        for _ in range(count):
            x = phi @ x
            free.append(x[0])
        assert first_command(np.array(free)) == pytest.approx(-L[i], rel=1e-5)


def beats(lengths, amplitude=2e-3, shape_length=0.6):
    """Motion whose beats have one shape, rest in between, and the age of the beat."""
    onsets = np.concatenate([[0.0], np.cumsum(lengths)])
    nodes = np.unique(np.concatenate([np.arange(0, onsets[-1], 0.004), [onsets[-1]]]))
    age = nodes - onsets[np.searchsorted(onsets[:-1], nodes, side="right") - 1]
    inside = age < shape_length
    w = 2 * np.pi / shape_length
    # (1 − cos)² leaves the rest with two derivatives.
    c, s = np.cos(w * age), np.sin(w * age)
    value = amplitude * np.where(inside, (1 - c) ** 2, 0.0)
    rate = amplitude * np.where(inside, 2 * w * s * (1 - c), 0.0)
    second = amplitude * np.where(inside, 2 * w**2 * (s**2 + c * (1 - c)), 0.0)
    coefficients = np.zeros((1, len(lengths), 2))
    coefficients[0, :, 1] = 1.0
    events = PiecewisePolynomial(breakpoints=onsets, coefficients=coefficients)
    return quintic_hermite(nodes, value, rate, second), events


def rms(specification, lengths):
    step = beat_preview_step(specification)
    tower = build_sampled_axis_loop(
        step, velocity_gain=VELOCITY_GAIN, stiffness=STIFFNESS, period=PERIOD, delay=DELAY
    )
    heart, events = beats(lengths)
    end = float(np.sum(lengths))
    inputs = axis_inputs(
        step, heart=heart, reference=constant_force(1.0).piecewise(end), events=events, end=end
    )
    settings = RunSettings(duration=end, step=5e-4, record_period=PERIOD)
    run = simulate_axis(tower, inputs=inputs, settings=settings)
    late = run.time > 0.6 * end
    return float((run["force"] - run["desired_force"])[late].std())


def test_beats_of_changing_length_are_previewed():
    lengths = np.random.default_rng(4).uniform(0.65, 1.1, 14)
    plain = rms(replace(PREVIEW, learning=0.0), lengths)
    learned = rms(PREVIEW, lengths)
    assert learned < 0.4 * plain


def test_the_interface_lists_the_beats_age():
    step = beat_preview_step(PREVIEW)
    assert step.events.entry_names == ("beat_age",)
    heart, _ = beats([1.0])
    with pytest.raises(ParameterError, match="events"):
        axis_inputs(step, heart=heart, reference=constant_force(1.0).piecewise(1.0), end=1.0)


def test_nonsense_is_refused():
    with pytest.raises(ParameterError, match="cell width"):
        replace(PREVIEW, cell_width=1e-5)
    with pytest.raises(ParameterError, match="learning"):
        replace(PREVIEW, learning=1.5)
