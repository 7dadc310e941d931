"""Read-only float64 arrays, the only kind a value type of this package may hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


def readonly(values: ArrayLike, shape: tuple[int, ...] | None = None) -> FloatArray:
    """Copy `values` to a read-only float64 array, checking its `shape` (-1 matches any size).

    Raises ValueError when the shape differs; the caller knows the name to report.
    """
    array = np.array(values, dtype=np.float64)
    if shape is not None and (
        array.ndim != len(shape)
        or any(want not in (-1, have) for want, have in zip(shape, array.shape, strict=True))
    ):
        raise ValueError(f"shape {array.shape} where {shape} is needed")
    array.setflags(write=False)
    return array
