"""Ensembles on the workers of a Dask cluster."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from itertools import islice
from typing import Any

from mrac_design.arrays import FloatArray
from mrac_design.errors import EnsembleError
from mrac_design.simulation.ensemble import Ensemble, work

_RETRIES = 5
"""Times a chunk is tried again after an error; a worker that dies loses nothing but time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DaskCluster:
    """Workers behind a Dask scheduler; each compiles for its own processor."""

    address: str
    """Address of the scheduler, tcp://host:port."""
    timeout: float = 10.0
    """Time after which the scheduler is taken to be away (s)."""

    def results(
        self, ensemble: Ensemble, chunks: Sequence[int]
    ) -> Iterator[tuple[int, FloatArray]]:
        """Chunks as they are finished; those of a lost worker go to another one.

        Raises EnsembleError when there is no scheduler, no worker, or no way to go on.
        """
        try:
            from distributed import Client, KilledWorker
            from distributed.comm.core import CommClosedError
        except ImportError as problem:
            raise EnsembleError(
                "clusters need dask and distributed: pip install 'mrac-design[cluster]'"
            ) from problem
        payload = pickle.dumps(ensemble, protocol=5)
        try:
            client = Client(self.address, timeout=self.timeout, set_as_default=False)
        except (OSError, ValueError) as problem:
            raise EnsembleError(
                f"no Dask scheduler answers at {self.address} within {self.timeout:g} s"
            ) from problem
        with client:
            if not client.scheduler_info(n_workers=-1)["workers"]:
                raise EnsembleError(f"the Dask cluster at {self.address} has no workers")
            try:
                yield from _as_completed(client, payload, chunks)
            except KilledWorker as problem:
                raise EnsembleError(
                    f"the workers at {self.address} die of the same chunk again and again: "
                    f"{problem}"
                ) from problem
            except (CommClosedError, CancelledError) as problem:
                raise EnsembleError(
                    f"the Dask scheduler at {self.address} went away: start it again; what a store "
                    "keeps is not run again"
                ) from problem


def _as_completed(
    client: Any, payload: bytes, chunks: Sequence[int]
) -> Iterator[tuple[int, FloatArray]]:
    """Results of the chunks, a few submitted ahead."""
    from distributed import as_completed

    # A task of its own: it goes to one worker, others fetch it from there, and a lost one is made
    # again by the scheduler.
    key = f"mrac-ensemble-{hashlib.sha256(payload).hexdigest()}"
    shared = client.submit(bytes, payload, key=key, retries=_RETRIES)

    def submit(number: int) -> object:
        return client.submit(work, shared, number, pure=False, retries=_RETRIES)

    waiting = iter(chunks)
    ahead = 4 * max(1, sum(client.nthreads().values()))
    pending = as_completed([submit(number) for number in islice(waiting, ahead)], loop=client.loop)
    for future in pending:
        yield future.result()
        number = next(waiting, None)
        if number is not None:
            pending.add(submit(number))
