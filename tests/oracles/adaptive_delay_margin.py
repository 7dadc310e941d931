"""Delay margin of the adaptive force loop from its closed forms on a fine grid of frequencies.

At a constant force adaptation adds the hidden integral action of speed λ:
L = κ Ks/(p(p + κ K2)) · (S/R + λ ω² Ao Am/(b0 R p (Am + λ(p + 2ξω)))) with the closed solution of
the Diophantine equation A R + b0 S = Ao Am, A = p(p + K2).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq


def adaptive_delay_margin(*, k2, omega, xi, ao, b0, speed, stiffness, strength):
    """Smallest phase lag over frequency at |L| = 1, in s."""
    r1 = 2 * xi * omega + ao - k2
    s0 = (2 * xi * omega * ao + omega**2 - k2 * r1) / b0
    s1 = ao * omega**2 / b0

    def loop(w):
        p = 1j * w
        Am = p**2 + 2 * xi * omega * p + omega**2
        hidden = speed * omega**2 * (p + ao) * Am
        hidden /= b0 * p * (Am + speed * (p + 2 * xi * omega))
        plant = strength * stiffness / (p * (p + strength * k2))
        return plant * (s0 * p + s1 + hidden) / (p + r1)

    grid = np.geomspace(1e-1, 1e5, 20001)
    above = np.log(np.abs(loop(grid)))
    lags = []
    for i in np.flatnonzero(np.sign(above[1:]) != np.sign(above[:-1])):
        w = brentq(lambda x: np.log(abs(loop(x))), grid[i], grid[i + 1], xtol=1e-9, rtol=1e-14)
        lags.append(((np.pi + np.angle(loop(w))) % (2 * np.pi)) / w)
    return min(lags)
