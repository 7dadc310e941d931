"""Active observers: Kalman gain, separation, order of rejection, the cascade."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest

from mrac_design.controller.rivals.active_observer import (
    active_observer,
    observed_disturbance_gain,
    state_feedback,
)
from mrac_design.controller.rivals.observation import difference_chain, sampled_plant
from mrac_design.errors import ParameterError
from tests.controller.rivals.cases import (
    DELAY,
    DOMAIN,
    FORCE_LOOP,
    MOTION_LOOP,
    OBSERVER,
    PERIOD,
    PLANT,
    STIFFNESS,
    VELOCITY_GAIN,
)
from tests.oracles import sampled_force_loop as loop


@pytest.mark.parametrize("order", [1, 2])
def test_the_kalman_gain_is_the_riccati_equations(order):
    tuning = replace(FORCE_LOOP, order=order)
    gain = observed_disturbance_gain(sampled_plant(PLANT, DOMAIN, delay=0), tuning)
    phi, gamma = loop.plant(STIFFNESS, VELOCITY_GAIN, PERIOD)
    A = np.eye(2 + order) + np.diag(np.ones(1 + order), 1)
    A[:2, :2], A[:2, 2] = phi, gamma
    A[0, 3:] = A[1, 3:] = 0.0
    noise = np.zeros((2 + order, 2))
    noise[:2, 0], noise[-1, 1] = tuning.input_noise * gamma, tuning.drive
    C = np.eye(2 + order)[0]
    by_hand = loop.riccati_gain(A, noise, C, tuning.force_noise)
    np.testing.assert_allclose(gain, by_hand, rtol=1e-6)
    predictor, _, _ = control.dlqe(A, noise, C[None, :], np.eye(2), [[tuning.force_noise**2]])
    np.testing.assert_allclose(A @ gain, np.ravel(predictor), rtol=1e-8)


def test_dead_time_does_not_move_the_designed_poles():
    for delay in (0, 1, 3):
        controller = active_observer(replace(OBSERVER, delay=delay))
        rows, command = controller.matrices()
        phi, gamma = loop.plant(STIFFNESS, VELOCITY_GAIN, PERIOD)
        M = loop.closed_matrix(rows, command, phi, gamma, delay)
        pole = np.exp(-PERIOD / FORCE_LOOP.time_constant)
        model = sampled_plant(PLANT, DOMAIN, delay=delay).with_disturbance(*difference_chain(1))
        K = observed_disturbance_gain(sampled_plant(PLANT, DOMAIN, delay=0), FORCE_LOOP)
        observer = np.linalg.eigvals(model.transition @ (np.eye(3) - np.outer(K, [1, 0, 0])))
        prefilter = np.exp(-PERIOD * 50.0)
        known = [pole, pole, *observer, prefilter, prefilter] + [0.0] * (2 * delay)
        # Polynomials, since double poles themselves are known to half the digits only.
        np.testing.assert_allclose(
            np.poly(np.linalg.eigvals(M)), np.real(np.poly(known)), atol=1e-6
        )


@pytest.mark.parametrize(
    ("specification", "order"),
    [
        (OBSERVER, 1),
        (replace(OBSERVER, force_loop=replace(FORCE_LOOP, order=2, drive=0.1)), 2),
        (replace(OBSERVER, force_loop=replace(FORCE_LOOP, order=3, drive=0.02)), 3),
        (replace(OBSERVER, motion_loop=MOTION_LOOP), 2),
    ],
)
def test_slow_motion_is_rejected_with_the_order_of_the_observers(specification, order):
    rows, command = active_observer(specification).matrices()
    phi, gamma = loop.plant(STIFFNESS, VELOCITY_GAIN, PERIOD)
    M = loop.closed_matrix(rows, command, phi, gamma, DELAY)
    n = rows.shape[0]
    drive = np.zeros(M.shape[0])
    drive[n : n + 2] = gamma
    gains = []
    for frequency in (0.05, 0.1):
        z = np.exp(2j * np.pi * frequency * PERIOD)
        gains.append(abs(np.linalg.solve(z * np.eye(M.shape[0]) - M, drive)[n]))
    # |y/p| ~ ω^N as ω → 0: doubling the frequency raises the error 2^N times.
    assert np.log2(gains[1] / gains[0]) == pytest.approx(order, abs=0.02)


def test_the_cascade_leaves_less_of_the_heart_than_one_observer():
    def rms(specification):
        rows, command = active_observer(specification).matrices()
        phi, gamma = loop.plant(STIFFNESS, VELOCITY_GAIN, PERIOD)
        k = np.arange(6000)
        forces = loop.run(
            rows, command, phi, gamma, DELAY,
            disturbance=0.5 * np.sin(2 * np.pi * 1.25 * PERIOD * k),
            reference=np.zeros(k.size), state=np.zeros(rows.shape[0]), plant_state=[0, 0],
        )  # fmt: skip
        return forces[3000:].std()

    assert rms(replace(OBSERVER, motion_loop=MOTION_LOOP)) < 0.4 * rms(OBSERVER)


def test_static_feedback_is_critically_damped():
    L = state_feedback(sampled_plant(PLANT, DOMAIN, delay=0), DOMAIN, 0.01)
    phi, gamma = loop.plant(STIFFNESS, VELOCITY_GAIN, PERIOD)
    pole = np.exp(-0.1)
    closed = phi - np.outer(gamma, L)
    assert np.trace(closed) == pytest.approx(2 * pole, rel=1e-10)
    assert np.linalg.det(closed) == pytest.approx(pole**2, rel=1e-10)


def test_nonsense_is_refused():
    with pytest.raises(ParameterError, match="time constant"):
        replace(FORCE_LOOP, time_constant=0.0)
    with pytest.raises(ParameterError, match="order"):
        active_observer(replace(OBSERVER, force_loop=replace(FORCE_LOOP, order=0)))
    with pytest.raises(ParameterError, match="delay"):
        active_observer(replace(OBSERVER, delay=-1))
