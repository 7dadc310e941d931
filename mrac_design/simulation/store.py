"""Finished chunks of an ensemble on disk, in Zarr."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.errors import EnsembleError


@dataclass(slots=True)
class EnsembleStore:
    """A Zarr group: `metrics` (runs, metrics), and `finished`, one flag a chunk, written last."""

    path: Path
    """Folder of the group."""
    _group: Any = field(default=None, init=False, repr=False)

    def open(self, *, fingerprint: str, metrics: tuple[str, ...], runs: int, chunk: int) -> None:
        """Make the group, or take up the one that is there.

        Raises EnsembleError when it belongs to another ensemble, or Zarr is not installed, or
        the folder cannot be written.
        """
        try:
            import zarr
        except ImportError as problem:
            raise EnsembleError(
                "keeping an ensemble on disk needs zarr: pip install 'mrac-design[cluster]'"
            ) from problem
        try:
            group = zarr.open_group(self.path, mode="a")
            if "fingerprint" not in group.attrs:
                group.create_array(
                    "metrics",
                    shape=(runs, len(metrics)),
                    chunks=(chunk, len(metrics)),
                    dtype="f8",
                    fill_value=float("nan"),
                    overwrite=True,
                )
                group.create_array(
                    "finished", shape=(-(-runs // chunk),), chunks=(1,), dtype="u1", fill_value=0,
                    overwrite=True,
                )  # fmt: skip
                group.attrs.update(
                    {"fingerprint": fingerprint, "metrics": list(metrics), "chunk": chunk}
                )
        except OSError as problem:
            raise EnsembleError(f"{self.path} cannot be written: {problem}") from problem
        if group.attrs["fingerprint"] != fingerprint:
            raise EnsembleError(
                f"{self.path} holds another ensemble (other runs, seed, system or settings): "
                "choose another folder, or remove this one to start anew"
            )
        self._group = group

    def finished(self) -> frozenset[int]:
        """Numbers of the chunks that are there."""
        flags = np.asarray(self._group["finished"][:])
        return frozenset(int(number) for number in np.flatnonzero(flags))

    def read(self, number: int) -> FloatArray:
        """Metrics of a chunk."""
        chunk = int(self._group.attrs["chunk"])
        rows: FloatArray = np.asarray(
            self._group["metrics"][number * chunk : (number + 1) * chunk], dtype=float
        )
        return rows

    def write(self, number: int, rows: FloatArray) -> None:
        """Keep a chunk; its flag comes last, so half a chunk does not count.

        Raises EnsembleError when the disk is full or gone; what was kept stays usable.
        """
        chunk = int(self._group.attrs["chunk"])
        try:
            self._group["metrics"][number * chunk : number * chunk + len(rows)] = rows
            self._group["finished"][number] = 1
        except OSError as problem:
            raise EnsembleError(
                f"{self.path} cannot be written: {problem}; finished chunks are kept, run again "
                "to go on"
            ) from problem
