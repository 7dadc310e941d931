"""A force plant under a sampled linear controller, from closed-form exponentials and loops.

    y' = v,   v' = Ks (u + p) − K2 v        u, p held over each period h

The controller is a table of rows over [state, y, r, u_applied]; commands act `delay` samples late.
"""

from __future__ import annotations

import numpy as np


def plant(Ks, K2, h):
    """(Φ, Γ) of (y, v) with the command held, from the exponential written out."""
    if K2 == 0.0:
        return np.array([[1.0, h], [0.0, 1.0]]), Ks * np.array([h**2 / 2, h])
    e = np.exp(-K2 * h)
    rate = (1 - e) / K2
    return np.array([[1.0, rate], [0.0, e]]), Ks * np.array([(h - rate) / K2, rate])


def closed_matrix(rows, command, phi, gamma, delay):
    """Transition of (controller, y, v, commands on their way) without reference."""
    n = rows.shape[0]
    size = n + 2 + delay
    y = np.zeros(size)
    y[n] = 1.0
    u = np.zeros(size)
    u[:n] = command[:n]
    u += command[n] * y
    acting = u if delay == 0 else np.eye(size)[-1]
    M = np.zeros((size, size))
    M[:n, :n] = rows[:, :n]
    M[:n] += np.outer(rows[:, n], y) + np.outer(rows[:, n + 2], u)
    M[n : n + 2, n : n + 2] = phi
    M[n : n + 2] += np.outer(gamma, acting)
    if delay:
        M[n + 2] = u
        M[np.arange(n + 3, size), np.arange(n + 2, size - 1)] = 1.0
    return M


def run(rows, command, phi, gamma, delay, *, disturbance, reference, state, plant_state):
    """Forces y(k) while p(k) and r(k) act, sample by sample."""
    state, x = np.array(state, dtype=float), np.array(plant_state, dtype=float)
    waiting = [0.0] * delay
    forces = []
    for p, r in zip(disturbance, reference, strict=True):
        forces.append(x[0])
        columns = np.concatenate([state, [x[0], r, 0.0]])
        u = command @ columns
        columns[-1] = u
        waiting = [u, *waiting]
        state, x = rows @ columns, phi @ x + gamma * (waiting.pop() + p)
    return np.array(forces)


def riccati_gain(phi, drive, output, force_noise, count=20000):
    """Filter gain of the steady Kalman filter by running the covariance forward."""
    P = np.eye(phi.shape[0])
    for _ in range(count):
        K = P @ output / (output @ P @ output + force_noise**2)
        P = phi @ (P - np.outer(K, output @ P)) @ phi.T + drive @ drive.T
    return P @ output / (output @ P @ output + force_noise**2)
