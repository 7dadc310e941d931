"""Names for the entries of the flat vectors that generated code works on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray, readonly


@dataclass(frozen=True, slots=True)
class Layout:
    """Ordered named blocks of a flat vector: the one place that knows which entry is what."""

    blocks: tuple[tuple[str, int], ...]
    """(name, length) of each block, in order; names are unique."""

    def __post_init__(self) -> None:
        names = [name for name, _ in self.blocks]
        assert len(set(names)) == len(names), f"duplicate block names in {names}"

    @property
    def size(self) -> int:
        """Total length of the vector."""
        return sum(length for _, length in self.blocks)

    @property
    def slices(self) -> dict[str, slice]:
        """Where each block lies."""
        ends = accumulate(length for _, length in self.blocks)
        return {
            name: slice(end - length, end)
            for (name, length), end in zip(self.blocks, ends, strict=True)
        }

    @property
    def entry_names(self) -> tuple[str, ...]:
        """A name for every entry: the block's own if its length is 1, else `name[i]`."""
        return tuple(
            name if length == 1 else f"{name}[{i}]"
            for name, length in self.blocks
            for i in range(length)
        )

    def split(self, vector: Any) -> dict[str, Any]:
        """Blocks of a flat vector (CasADi, or NumPy with the entries on the last axis)."""
        if isinstance(vector, np.ndarray):
            return {name: vector[..., part] for name, part in self.slices.items()}
        return {name: vector[part] for name, part in self.slices.items()}

    def symbols(self, name: str) -> ca.SX:
        """A CasADi column vector of this layout's size."""
        return ca.SX.sym(name, self.size)

    def pack(self, values: Mapping[str, ArrayLike]) -> FloatArray:
        """A flat read-only array from one value per block."""
        assert set(values) == {name for name, _ in self.blocks}, sorted(values)
        return readonly(
            np.concatenate(
                [
                    np.broadcast_to(np.asarray(values[name], dtype=float).ravel(), (length,))
                    for name, length in self.blocks
                ]
            )
            if self.blocks
            else np.zeros(0)
        )

    def join(self, values: Mapping[str, ca.SX]) -> ca.SX:
        """A flat CasADi column vector from one expression per block."""
        assert set(values) == {name for name, _ in self.blocks}, sorted(values)
        return ca.vertcat(*(values[name] for name, _ in self.blocks))

    def prefixed(self, prefix: str) -> Layout:
        """The same blocks under `prefix` + name."""
        return Layout(tuple((prefix + name, length) for name, length in self.blocks))
