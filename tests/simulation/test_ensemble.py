"""Ensembles: the same table whoever computes it, and nothing lost on the way."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mrac_design.errors import EnsembleError, ParameterError
from mrac_design.simulation import ensemble as ensemble_module
from mrac_design.simulation.cluster import DaskCluster
from mrac_design.simulation.compilation import find_compiler
from mrac_design.simulation.dormand_prince_8 import DORMAND_PRINCE_8
from mrac_design.simulation.engine import CompiledEngine
from mrac_design.simulation.ensemble import (
    LocalThreads,
    chunk_metrics,
    generator,
    group_engine,
    run_ensemble,
)
from mrac_design.simulation.lanes import LaneEngine
from mrac_design.simulation.run import run
from mrac_design.simulation.store import EnsembleStore
from mrac_design.simulation.tableau import DORMAND_PRINCE_5, RK4
from tests.simulation.ensemble_problem import pendulums

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler here")


SCHEDULER = """
import sys, time
from distributed import LocalCluster
sys.path.insert(0, sys.argv[1])
cluster = LocalCluster(
    n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None,
    protocol="tcp", scheduler_port=0,
)
print(cluster.scheduler_address, flush=True)
time.sleep(60)
"""
"""Scheduler and worker in one process, to be killed."""


def single_runs(ensemble, engine):
    """The same metrics from ordinary runs and NumPy."""
    rows = []
    for number in range(ensemble.runs):
        case = ensemble.sampler(number, generator(ensemble.seed, number))
        recording = run(
            engine,
            ensemble.system,
            inputs=case.inputs,
            parameters=case.parameters,
            initial_state=case.initial_state,
            settings=ensemble.settings,
        )
        late = recording.time >= 0.5
        rows.append([np.abs(recording.outputs[:, 0]).max(), recording.outputs[late, 1].mean()])
    return np.array(rows)


@pytest.mark.parametrize("sampled", [False, True])
def test_table_is_that_of_single_runs(sampled):
    problem = pendulums(sampled=sampled)
    engine = CompiledEngine(
        problem.system, problem.method, input_powers=3, compiler=find_compiler()
    )
    expected = single_runs(problem, engine)
    result = run_ensemble(problem)
    # A largest value has the bits of the run it comes from; a sum depends on its order.
    assert np.array_equal(result["largest_angle"], expected[:, 0])
    assert result["mean_energy"] == pytest.approx(expected[:, 1], rel=1e-12)
    assert result.diverged == 0


@pytest.mark.parametrize("method", [RK4, DORMAND_PRINCE_5, DORMAND_PRINCE_8])
@pytest.mark.parametrize("sampled", [False, True])
def test_each_lane_has_the_bits_of_a_scalar_run(method, sampled):
    problem = pendulums(sampled=sampled, runs=8, chunk=8)
    shared = {"input_powers": 3, "compiler": find_compiler()}
    wide, narrow = (
        LaneEngine(problem.system, method, problem.reduction, lanes=lanes, **shared)
        for lanes in (8, 1)
    )
    assert np.array_equal(chunk_metrics(problem, wide, 0), chunk_metrics(problem, narrow, 0))


def test_threads_and_chunks_do_not_matter():
    table = run_ensemble(pendulums(), workers=LocalThreads(count=1)).table
    assert np.array_equal(run_ensemble(pendulums(), workers=LocalThreads(count=2)).table, table)
    assert np.array_equal(run_ensemble(pendulums(chunk=13)).table, table)
    assert not np.array_equal(run_ensemble(pendulums(seed=8)).table, table)


def test_without_compiler_the_runs_are_folded_afterwards(monkeypatch):
    table = run_ensemble(pendulums(runs=6)).table
    monkeypatch.setattr(ensemble_module, "find_compiler", lambda: None)
    monkeypatch.setattr("mrac_design.simulation.engine.find_compiler", lambda: None)
    # Other machines may not fuse products with sums.
    np.testing.assert_allclose(run_ensemble(pendulums(runs=6)).table, table, rtol=1e-10)


def test_diverged_run_is_told_from_the_others():
    usual = pendulums()

    def unstable(number, rng):
        case = usual.sampler(number, rng)
        damping = np.array([1.0, 1.0, -1e6 if number == 3 else 1.0])
        return replace(case, parameters=case.parameters * damping)

    problem = replace(usual, sampler=unstable)
    rows = chunk_metrics(problem, group_engine(problem), 0)
    assert list(np.flatnonzero(np.isnan(rows).any(axis=1))) == [3]
    others = [0, 1, 2, 4, 5, 6, 7, 8]
    assert np.array_equal(rows[others], chunk_metrics(usual, group_engine(usual), 0)[others])


def test_interrupted_ensemble_goes_on_where_it_was(tmp_path):
    table = run_ensemble(pendulums()).table

    def stop(fraction):
        if fraction > 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_ensemble(pendulums(), store=EnsembleStore(tmp_path / "e"), progress=stop)
    seen = []

    class Watching:
        def results(self, ensemble, chunks):
            seen.extend(chunks)
            yield from LocalThreads(count=1).results(ensemble, chunks)

    store = EnsembleStore(tmp_path / "e")
    result = run_ensemble(pendulums(), workers=Watching(), store=store)
    assert 0 < len(seen) < pendulums().chunks
    assert np.array_equal(result.table, table)
    # And a third time nothing is left to do.
    seen.clear()
    assert np.array_equal(run_ensemble(pendulums(), workers=Watching(), store=store).table, table)
    assert not seen


def test_killed_process_loses_nothing_that_was_finished(tmp_path):
    script = (
        "import sys, time\n"
        "from pathlib import Path\n"
        "from tests.simulation.ensemble_problem import pendulums\n"
        "from mrac_design.simulation.ensemble import run_ensemble\n"
        "from mrac_design.simulation.store import EnsembleStore\n"
        "run_ensemble(pendulums(), store=EnsembleStore(Path(sys.argv[1])),\n"
        "             progress=lambda f: (print(f, flush=True), time.sleep(0.3)))\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path / "e")],
        stdout=subprocess.PIPE,
        cwd=Path(__file__).parents[2],
    )
    process.stdout.readline()
    process.stdout.readline()
    process.send_signal(signal.SIGKILL)
    process.wait()
    store = EnsembleStore(tmp_path / "e")
    result = run_ensemble(pendulums(), store=store)
    assert np.array_equal(result.table, run_ensemble(pendulums()).table)


def test_store_of_another_ensemble_is_refused(tmp_path):
    run_ensemble(pendulums(runs=4), store=EnsembleStore(tmp_path / "e"))
    with pytest.raises(EnsembleError, match="another ensemble"):
        run_ensemble(pendulums(runs=4, seed=8), store=EnsembleStore(tmp_path / "e"))


def test_fingerprint_is_the_same_in_another_process():
    code = (
        "from tests.simulation.ensemble_problem import pendulums; print(pendulums().fingerprint())"
    )
    root = Path(__file__).parents[2]
    told = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=root, check=True
    )
    assert told.stdout.strip() == pendulums().fingerprint()
    assert pickle.loads(pickle.dumps(pendulums())).fingerprint() == pendulums().fingerprint()


def test_cluster_with_workers_killed_gives_the_same_table(monkeypatch):
    """Both die, one after the other: what they were sent once must survive as well."""
    distributed = pytest.importorskip("distributed")
    problem = pendulums(runs=400, chunk=4)
    table = run_ensemble(problem).table
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        victims = [worker.pid for worker in cluster.workers.values()]
        instants = [0.1, 0.5]

        def kill(fraction):
            if instants and fraction > instants[0]:
                del instants[0]
                os.kill(victims.pop(), signal.SIGKILL)

        sent = []
        submit = distributed.Client.submit

        def weighed(client, function, *arguments, **options):
            sent.extend(len(item) for item in arguments if isinstance(item, bytes))
            return submit(client, function, *arguments, **options)

        monkeypatch.setattr(distributed.Client, "submit", weighed)
        workers = DaskCluster(address=cluster.scheduler_address)
        result = run_ensemble(problem, workers=workers, progress=kill)
    assert np.array_equal(result.table, table)
    assert not victims
    assert sent == [len(pickle.dumps(problem, protocol=5))]


def test_scheduler_that_goes_away_is_one_clear_sentence():
    pytest.importorskip("distributed")
    server = subprocess.Popen(
        [sys.executable, "-c", SCHEDULER, str(Path(__file__).parents[2])],
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    address = server.stdout.readline().strip()
    with pytest.raises(EnsembleError, match=f"{address} went away: start it again") as told:
        run_ensemble(
            pendulums(runs=400, chunk=4),
            workers=DaskCluster(address=address),
            progress=lambda fraction: server.kill(),
        )
    server.wait()
    assert "\n" not in str(told.value)


def test_cluster_that_is_not_there_is_one_clear_sentence():
    pytest.importorskip("distributed")
    begin = time.monotonic()
    with pytest.raises(EnsembleError, match=r"no Dask scheduler answers at tcp://127.0.0.1:9") as e:
        run_ensemble(
            pendulums(runs=4), workers=DaskCluster(address="tcp://127.0.0.1:9", timeout=1.0)
        )
    assert "\n" not in str(e.value)
    assert time.monotonic() - begin < 10


@pytest.mark.parametrize("change", [{"runs": 0}, {"chunk": 0}])
def test_empty_ensembles_are_refused(change):
    with pytest.raises(ParameterError, match="at least 1"):
        pendulums(**change)
