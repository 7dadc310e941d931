"""Receding-horizon controllers: the minimum itself, deadbeat, prediction, internal models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from mrac_design.controller.rivals.harmonics import Rhythm
from mrac_design.controller.rivals.prediction import Horizon, horizon_gains
from mrac_design.controller.rivals.predictive import predictive_control, predictive_model
from mrac_design.controller.rivals.predictive_observer import predictive_observer
from mrac_design.errors import ParameterError
from tests.controller.rivals.cases import (
    BEAT,
    DELAY,
    PERIOD,
    PREDICTIVE,
    PREDICTIVE_OBSERVER,
    RHYTHMS,
    STIFFNESS,
    VELOCITY_GAIN,
)
from tests.oracles import sampled_force_loop as loop

PHI, GAMMA = loop.plant(STIFFNESS, VELOCITY_GAIN, PERIOD)
ONE_STEP = replace(PREDICTIVE, observer_poles=())


def closed(controller, delay=DELAY):
    rows, command = controller.matrices()
    return loop.closed_matrix(rows, command, PHI, GAMMA, delay)


def test_the_closed_form_is_the_minimum_found_numerically():
    horizon = PREDICTIVE.horizon
    model = predictive_model(ONE_STEP)
    random = np.random.default_rng(1)
    gap = random.standard_normal(horizon.last - horizon.first + 1)
    step = model.step_response(horizon.last)

    def cost(moves):
        y = sum(
            move * np.concatenate([np.zeros(i), step[: step.size - i]])
            for i, move in enumerate(moves)
        )
        return ((gap - y[horizon.first :]) ** 2).sum() + horizon.penalty * (moves**2).sum()

    scale = 1e-3  # brings the minimiser's variables to order one
    found = minimize(lambda m: cost(m / scale), np.zeros(horizon.moves), method="BFGS", tol=1e-12)
    expected = horizon_gains(step, horizon) @ gap
    assert found.x[0] / scale == pytest.approx(expected, rel=2e-3)


def test_without_penalty_it_is_deadbeat():
    # Three increments carry (y, ẏ, held command) to rest; the dead time adds its samples.
    horizon = Horizon(first=3 + DELAY, last=5 + DELAY, moves=3, penalty=0.0)
    M = closed(predictive_control(replace(ONE_STEP, horizon=horizon)))
    states = [name for name in range(M.shape[0]) if name not in _prefilter_entries()]
    core = M[np.ix_(states, states)]
    power = np.linalg.matrix_power(core, 3 + DELAY + 6)
    # Increments reach 1e6 (m/s²)/N, so 1e-16 of them is what rounding leaves.
    assert np.abs(power).max() < 1e-9 * np.abs(core).max()
    assert np.abs(np.linalg.matrix_power(core, 2)).max() > 1.0


def _prefilter_entries():
    slices = predictive_control(ONE_STEP).columns.state.slices
    return range(slices["prefilter"].start, slices["prefilter"].stop)


def test_free_response_is_what_the_plant_then_does():
    model = predictive_model(ONE_STEP)
    random = np.random.default_rng(2)
    u = random.standard_normal(40)
    u[30:] = u[29]
    y, x = [], np.zeros(2)
    for k in range(40):
        y.append(x[0])
        x = PHI @ x + GAMMA * ((u[k - DELAY] if k >= DELAY else 0.0) + 0.7)
    newest = slice(30, 20, -1)
    # A constant disturbance is what the increments model takes away.
    predicted = model.free_response(
        np.array(y)[newest][:, None], u[29:19:-1][:, None], np.zeros((1, 1)), 9
    )
    np.testing.assert_allclose(predicted[:, 0], y[31:40], rtol=1e-8, atol=1e-9)


def test_noise_polynomial_puts_the_observers_poles():
    poles = np.linalg.eigvals(closed(predictive_control(PREDICTIVE)))
    for wanted in PREDICTIVE.observer_poles:
        assert np.abs(poles - wanted).min() < 1e-6
    without = np.linalg.eigvals(closed(predictive_control(ONE_STEP)))
    assert np.abs(without - PREDICTIVE.observer_poles[0]).min() > 1e-2


def errors(controller, disturbance, reference=0.0):
    rows, command = controller.matrices()
    return reference - loop.run(
        rows, command, PHI, GAMMA, DELAY,
        disturbance=disturbance, reference=np.full(disturbance.size, reference),
        state=np.zeros(rows.shape[0]), plant_state=[0, 0],
    )  # fmt: skip


@pytest.mark.parametrize("controller", [predictive_control(PREDICTIVE),
                                        predictive_observer(PREDICTIVE_OBSERVER)])  # fmt: skip
def test_a_constant_push_leaves_no_error(controller):
    found = errors(controller, np.full(3000, 2.0))
    assert np.abs(found).max() > 1e-3
    assert abs(found[-1]) < 1e-9


def test_breathing_of_any_shape_disappears_with_its_period_in_the_model():
    breath = 120
    k = np.arange(40 * breath)
    motion = np.sin(2 * np.pi * k / breath) + 0.4 * np.cos(6 * np.pi * k / breath)
    plain = errors(predictive_control(PREDICTIVE), motion)
    knowing = errors(predictive_control(replace(PREDICTIVE, breath=breath)), motion)
    ratio = np.abs(knowing[-breath:]).max() / np.abs(plain[-breath:]).max()
    assert ratio < 1e-3
    other = np.sin(2 * np.pi * k / (1.37 * breath))
    missed = errors(predictive_control(replace(PREDICTIVE, breath=breath)), other)
    assert np.abs(missed[-breath:]).max() > 0.1 * np.abs(plain[-breath:]).max()


def test_the_beats_harmonics_disappear_with_their_observer():
    k = np.arange(12000)
    phase = 2 * np.pi * BEAT.frequency * PERIOD * k
    motion = np.sin(phase) + 0.6 * np.cos(2 * phase) + 0.3 * np.sin(3 * phase)
    plain = errors(predictive_control(PREDICTIVE), motion)[-1600:]
    knowing = errors(predictive_control(replace(PREDICTIVE, rhythms=RHYTHMS)), motion)[-1600:]
    # What stays is the price λ sets on moving at all.
    assert knowing.std() < 0.15 * plain.std()


def test_a_breath_of_thousands_of_samples_disappears_with_its_harmonics():
    breath = Rhythm(frequency=0.25, harmonics=2, drive=1e-2)
    assert round(1 / (breath.frequency * PERIOD)) == 4000
    k = np.arange(60_000)
    phase = 2 * np.pi * PERIOD * k
    motion = (
        4 * np.sin(0.25 * phase) + 2 * np.cos(0.5 * phase)
        + np.sin(1.25 * phase) + 0.6 * np.cos(2.5 * phase)
    )  # fmt: skip
    beat_only, both = (
        predictive_control(replace(PREDICTIVE, rhythms=replace(RHYTHMS, rhythms=rhythms)))
        for rhythms in ((BEAT,), (BEAT, breath))
    )
    assert both.columns.state.size == beat_only.columns.state.size + 4
    without, within = (errors(law, motion)[-8000:].std() for law in (beat_only, both))
    assert within < 0.05 * without
    # Told a wrong breath, it is no better than without one.
    wrong = replace(RHYTHMS, rhythms=(BEAT, replace(breath, frequency=0.37)))
    missed = errors(predictive_control(replace(PREDICTIVE, rhythms=wrong)), motion)[-8000:].std()
    assert missed > 10 * within


def test_nonsense_is_refused():
    with pytest.raises(ParameterError, match="N1 <= N2"):
        Horizon(first=5, last=3, moves=1, penalty=0.0)
    with pytest.raises(ParameterError, match="free"):
        # Nothing moved inside the dead time can be seen in the horizon.
        predictive_control(
            replace(ONE_STEP, horizon=Horizon(first=1, last=2, moves=2, penalty=0.0), delay=3)
        )
    with pytest.raises(ParameterError, match="breath"):
        replace(PREDICTIVE, breath=10)
    with pytest.raises(ParameterError, match="harmonics"):
        Rhythm(frequency=1.0, harmonics=0, drive=1.0)
    with pytest.raises(ParameterError, match="differ"):
        replace(RHYTHMS, rhythms=(BEAT, replace(BEAT, frequency=2.5)))
