"""C functions that evaluate a robot's terms for many postures in a row.

`evaluate(n, q, qd, torque, out)`: q, qd, torque are (n, 5), `out` is (64, 65), row i % 64 of which
takes M by columns (25), V + G (5), the tip's Jacobian (25), J̇q̇ (5) and q̈ (5) of posture i. What
the rows of the Jacobian are is the peer's own affair.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

Evaluate = Callable[..., object]
"""The foreign function described above."""
COUNT = 1024
"""Postures evaluated in a call: few enough to stay in the cache."""
ROWS, COLUMNS = 64, 65
"""Shape of the results."""


def pointers(*arrays: np.ndarray) -> list[ctypes.c_void_p]:
    """Addresses to pass."""
    return [array.ctypes.data_as(ctypes.c_void_p) for array in arrays]


def aligned(shape: tuple[int, ...]) -> np.ndarray:
    """Zeros that begin at a multiple of 64 bytes."""
    size = int(np.prod(shape))
    raw = np.zeros(size + 8)
    first = (-raw.ctypes.data // 8) % 8
    return raw[first : first + size].reshape(shape)
