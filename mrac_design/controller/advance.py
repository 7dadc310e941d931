"""How a controller's states move in either time domain: derivatives, or values a period later."""

from __future__ import annotations

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.time_domain import Discrete, TimeDomain


def linear_advance(
    domain: TimeDomain, A: FloatArray, B: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(F, G) with which x' = A x + B v advances as F x + G v.

    In continuous time that is the derivative, so (A, B) itself. In discrete time it is the value
    one period later with v held, exact for any A through one exponential of [[A, B], [0, 0]].
    """
    if not isinstance(domain, Discrete):
        return readonly(A), readonly(B)
    from scipy.linalg import expm  # a quarter of a second that continuous controllers can save

    n, m = B.shape
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = A, B
    transition = expm(block * domain.period)
    return readonly(transition[:n, :n]), readonly(transition[:n, n:])


def integral_advance(domain: TimeDomain, state: ca.SX, rate: ca.SX) -> ca.SX:
    """How a state with derivative `rate` advances: the rate itself, or a forward Euler step."""
    return state + domain.period * rate if isinstance(domain, Discrete) else rate
