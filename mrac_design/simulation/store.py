"""Finished chunks of an ensemble on disk, in Zarr."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray
from mrac_design.errors import EnsembleError
from mrac_design.publishing import staging_folder

_FORMAT = 2
"""Number of the layout below; a store of another one is refused."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredEnsemble:
    """What a store says of the ensemble it belongs to."""

    fingerprint: str
    """Hash of everything the table depends on."""
    version: str
    """Version of the package that began it."""
    runs: int
    """Number of runs."""
    seed: int
    """Seed of all draws."""
    chunk: int
    """Runs in a chunk."""
    metrics: tuple[str, ...]
    """Names of the columns."""

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.runs // self.chunk)


@dataclass(slots=True)
class EnsembleStore:
    """A Zarr group of `metrics` (runs, metrics) and `finished`, one number a chunk, written last.

    The number is a checksum of the chunk's metrics, and 0 while they are missing: what a disk lost
    or altered is told from what was computed.
    """

    path: Path
    """Folder of the group."""
    _group: Any = field(default=None, init=False, repr=False)
    _finished: Any = field(default=None, init=False, repr=False)
    _chunk: int = field(default=0, init=False, repr=False)

    def open(self, ensemble: StoredEnsemble) -> None:
        """Make the group, or take up the one that is there.

        Raises EnsembleError when it belongs to another ensemble, is damaged or no store, when
        Zarr is not installed, or the folder cannot be written.
        """
        try:
            import zarr
        except ImportError as problem:
            raise EnsembleError(
                "keeping an ensemble on disk needs zarr: pip install 'mrac-design[cluster]'"
            ) from problem
        if not self._begun():
            self._make(zarr, ensemble)
        with self._reading(self.path / "zarr.json"):
            group: Any = zarr.open_group(self.path, mode="r+")
            attributes = dict(group.attrs)
        self._check(attributes, ensemble)
        shapes = {"metrics": (ensemble.runs, len(ensemble.metrics)), "finished": (ensemble.chunks,)}
        for name, shape in shapes.items():
            with self._reading(self.path / name / "zarr.json"):
                if group[name].shape != shape:
                    raise ValueError(f"its shape is {group[name].shape}, not {shape}")
        self._group, self._chunk = group, ensemble.chunk
        self._finished = self._checksums(ensemble.chunks)

    def finished(self) -> frozenset[int]:
        """Numbers of the chunks that are there."""
        return frozenset(int(number) for number in np.flatnonzero(self._finished))

    def read(self, number: int) -> FloatArray:
        """Metrics of a finished chunk.

        Raises EnsembleError, naming its file, when they are not those that were kept.
        """
        first = number * self._chunk
        with self._reading(self.path / "metrics" / "c" / str(number) / "0", number):
            kept = self._group["metrics"][first : first + self._chunk]
            rows: FloatArray = np.asarray(kept, dtype=float)
            if _checksum(rows) != self._finished[number]:
                raise ValueError("its checksum is another one")
        return rows

    def write(self, number: int, rows: FloatArray) -> None:
        """Keep a chunk; its checksum comes last, so half a chunk does not count.

        Raises EnsembleError when the disk is full or gone; what was kept stays usable.
        """
        first = number * self._chunk
        try:
            self._group["metrics"][first : first + len(rows)] = rows
            self._group["finished"][number] = self._finished[number] = _checksum(rows)
        except OSError as problem:
            raise EnsembleError(
                f"{self.path} cannot be written: {problem}; finished chunks are kept, run again "
                "to go on"
            ) from problem

    def _begun(self) -> bool:
        """Whether there is something to take up."""
        try:
            found = next(self.path.iterdir(), None)
        except FileNotFoundError:
            return False
        except OSError as problem:
            raise EnsembleError(f"{self.path} cannot be written: {problem}") from problem
        if found is not None and not (self.path / "zarr.json").exists():
            raise EnsembleError(
                f"{self.path} holds {found.name}, but no zarr.json: it is no ensemble's store, or "
                "a damaged one; choose another folder"
            )
        return found is not None

    def _make(self, zarr: Any, ensemble: StoredEnsemble) -> None:
        """Make the group elsewhere and rename it, so that a store is never half there."""
        try:
            with staging_folder(self.path) as staging:
                new = staging / "store"
                group = zarr.open_group(new, mode="w-")
                group.create_array(
                    "metrics",
                    shape=(ensemble.runs, len(ensemble.metrics)),
                    chunks=(ensemble.chunk, len(ensemble.metrics)),
                    dtype="f8",
                    fill_value=float("nan"),
                )
                group.create_array(
                    "finished", shape=(ensemble.chunks,), chunks=(1,), dtype="u8", fill_value=0
                )
                group.attrs.update({"format": _FORMAT, **asdict(ensemble)})
                self.path.parent.mkdir(parents=True, exist_ok=True)
                new.replace(self.path)
        except OSError as problem:
            if not self._begun():  # else another process was faster, and its store serves as well
                raise EnsembleError(f"{self.path} cannot be written: {problem}") from problem

    def _check(self, attributes: dict[str, Any], wanted: StoredEnsemble) -> None:
        """Raise EnsembleError unless the store's own words are those of `wanted`."""
        if attributes.get("format") != _FORMAT:
            raise EnsembleError(
                f"{self.path} is a Zarr group, but no ensemble of this version of mrac_design: "
                "choose another folder"
            )
        if attributes.get("fingerprint") == wanted.fingerprint:
            return
        words = {"version": "mrac_design", "runs": "runs", "seed": "seed", "chunk": "runs a chunk"}
        others = [
            f"{name} {attributes.get(key)}, not {getattr(wanted, key)}"
            for key, name in words.items()
            if attributes.get(key) != getattr(wanted, key)
        ]
        raise EnsembleError(
            f"{self.path} holds another ensemble "
            f"({'; '.join(others) or 'another scenario, spread or step'}): choose another folder, "
            "or remove this one to start anew"
        )

    def _checksums(self, chunks: int) -> NDArray[np.uint64]:
        folder = self.path / "finished"
        with self._reading(folder / "zarr.json"):
            try:
                return np.array(self._group["finished"][:], np.uint64)
            except Exception:  # one by one they tell which it is
                for number in range(chunks):
                    with self._reading(folder / "c" / str(number), number):
                        self._group["finished"][number]
                raise

    @contextmanager
    def _reading(self, file: Path, number: int | None = None) -> Iterator[None]:
        """Turn what goes wrong inside into one sentence on `file`, of chunk `number` if any."""
        try:
            yield
        except EnsembleError:
            raise
        except PermissionError as problem:
            raise EnsembleError(f"{file} cannot be read: {problem.strerror}") from problem
        except Exception as problem:  # zarr and its codecs raise whatever they like
            words = " ".join(str(problem).split()) if file.exists() else "it is missing"
            remedy = f"remove {self.path} to start anew"
            if number is not None:
                flag = self.path / "finished" / "c" / str(number)
                remedy = f"remove {flag} and run again to compute its runs anew"
            raise EnsembleError(f"{file} is damaged ({words}): {remedy}") from problem


def _checksum(rows: FloatArray) -> int:
    """CRC-32 of the numbers' bytes, plus one: never 0."""
    return zlib.crc32(np.ascontiguousarray(rows, dtype="<f8").tobytes()) + 1
