"""`mrac ensemble`: from options to a table, kept, resumed, and one sentence for mistakes."""

from __future__ import annotations

import json
import os
import pickle
import resource
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from mrac_design.cli import ensemble as cli_ensemble
from mrac_design.ensemble_study import EnsembleChoice, prepare_ensemble, run_prepared
from mrac_design.errors import (
    EnsembleError,
    FileError,
    ParameterError,
    ScenarioFileError,
    SimulationError,
)
from mrac_design.metrics.tracking import tracking_metrics
from mrac_design.motion import ForceReference
from mrac_design.report.figures_ensemble import ensemble_figure, stiffness_bands
from mrac_design.simulation.compilation import find_compiler
from mrac_design.simulation.ensemble import LocalThreads, generator
from mrac_design.simulation.scenario import load_scenario, save_scenario
from mrac_design.study import run_study

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler here")

ROOT = Path(__file__).parents[1]
APP = typer.Typer()
APP.command()(cli_ensemble.ensemble)
SMALL_CHUNKS = (
    "import typer\n"
    "import mrac_design.ensemble_study.preparation as study\n"
    "from mrac_design.cli.ensemble import ensemble\n"
    "study._LARGEST_CHUNK = 8\n"
    "app = typer.Typer()\n"
    "app.command()(ensemble)\n"
    "app()\n"
)
"""Many pieces of little work, so that a stop finds some of them finished."""


def small(name: str = "nominal", duration: float = 0.1):
    """A planar robot on a beating heart for a tenth of a second."""
    base = load_scenario(name)
    return replace(
        base,
        robot="planar_2r",
        reference=ForceReference(steps=base.reference.steps[:2]),
        simulation=replace(base.simulation, duration=duration, settling=0.02),
    )


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    file = tmp_path_factory.mktemp("scenario") / "small.toml"
    save_scenario(small(), file)
    return str(file)


@pytest.fixture(scope="module")
def record():
    return run_prepared(prepare_ensemble(small(), EnsembleChoice(runs=60, motion_seeds=3)))


@pytest.fixture
def unillustrated(monkeypatch):
    """Pictures take longer than the runs here."""
    monkeypatch.setattr(
        "mrac_design.report.figures_ensemble.save_ensemble_figure", lambda record, folder: ()
    )


def run(*words: str, status: int = 0) -> str:
    result = CliRunner().invoke(APP, words, catch_exceptions=False)
    assert result.exit_code == status, result.output
    return result.stdout if status == 0 else result.output


def table(folder: Path) -> np.ndarray:
    return np.load(folder / "runs.npz")["table"]


def test_writes_summary_runs_and_picture(path, tmp_path):
    out = tmp_path / "deep" / "out"
    words = ("-s", path, "-n", "40", "--stiffness-range", "700", "900", "--out", str(out))
    values = json.loads(run(*words, "--json"))
    assert values == json.loads((out / "summary.json").read_text())
    assert (values["runs"], values["diverged"], values["drawn"]["motions"]) == (40, 0, 32)
    archive = np.load(out / "runs.npz")
    stiffness = archive["draws"][:, list(archive["columns"]).index("stiffness")]
    assert 700 <= stiffness.min() < 750 < 850 < stiffness.max() <= 900
    column = archive["table"][:, list(archive["metrics"]).index("max_force_error[1]")]
    told = values["metrics"]["max_force_error_N"]["Y"]
    assert told["largest"] == column.max()
    assert told["median"] == np.median(column)
    # The integrator's error lies far below the smallest error it is used to judge.
    assert values["change_with_half_the_step_N"] < 1e-3 * column.min()
    assert ElementTree.parse(out / "ensemble.svg").getroot().tag.endswith("svg")
    assert (out / "ensemble.png").read_bytes()[1:4] == b"PNG"
    text = run(*words)
    assert "Ks 700 to 900 N/m" in text
    assert "diverged: 0" in text


@pytest.mark.parametrize("variant", ["frozen", "adaptive_inverse"])
def test_an_ensemble_of_no_spread_is_the_study(variant):
    scenario = small()
    choice = EnsembleChoice(
        runs=2, stiffness_range=(800.0, 800.0), inertia_spread=0.0, motion_seeds=1,
        gain_range=None if variant == "frozen" else (1.0, 1.0), variant=variant,
        step=scenario.simulation.step,
    )  # fmt: skip
    record = run_prepared(prepare_ensemble(scenario, choice))
    trajectory = run_study(scenario).trajectories[variant]
    told = tracking_metrics(trajectory, settling=scenario.simulation.settling)
    expected = [axis.max_force_error_N for axis in told.values()]
    # Same method and step; factors of one and a shift of zero may still round.
    assert record.metric("max_force_error")[1] == pytest.approx(expected, rel=1e-9)


def test_each_run_is_the_study_of_its_own_truth(record):
    """A drawn stiffness and gain act as if the scenario had named them."""
    scenario = small()
    choice = EnsembleChoice(
        runs=6, inertia_spread=0.0, motion_seeds=1, step=scenario.simulation.step
    )
    several = run_prepared(prepare_ensemble(scenario, choice))
    stiffness, gain = several.drawn("stiffness"), several.drawn("adaptation_gain")
    assert np.ptp(stiffness) > 100
    assert np.ptp(gain) > 0.2
    own = replace(
        scenario,
        stiffness=float(stiffness[4]),
        adaptation=replace(scenario.adaptation, gain=float(gain[4])),
    )
    told = tracking_metrics(run_study(own).trajectories["adaptive_inverse"], settling=0.02)
    expected = [axis.max_force_error_N for axis in told.values()]
    assert several.metric("max_force_error")[4] == pytest.approx(expected, rel=1e-6)


def test_only_the_true_bodies_are_scaled():
    prepared = prepare_ensemble(small(), EnsembleChoice(inertia_spread=0.2))
    spread, layout = prepared.spread, prepared.ensemble.system.parameters
    case, row = spread(3, generator(0, 3)), spread.draw(generator(0, 3))
    factors = case.parameters / np.where(spread.parameters == 0, 1, spread.parameters)
    inertia = layout.slices["inertia"]
    # Each body's entries share one factor, which is that body's.
    assert sorted(set(factors[inertia].round(12))) == sorted(set(row[3:].round(12)))
    assert np.array_equal(
        case.parameters[layout.slices["linearisation"]],
        spread.parameters[layout.slices["linearisation"]],
    )


def test_runs_start_in_equilibrium_whatever_the_tissue():
    prepared = prepare_ensemble(small(), EnsembleChoice(motion_seeds=2))
    for number in range(4):
        case = prepared.spread(number, generator(0, number))
        stiffness = case.parameters[list(prepared.spread.stiffness_places)]
        depth = prepared.spread.tip - case.inputs(0.0)[:2, 0]
        assert stiffness * depth == pytest.approx(case.inputs(0.0)[2:4, 0], rel=1e-9)


def test_motion_seeds_give_motions_and_noise_of_their_own():
    sampled = replace(small(), sampling=load_scenario("reality").sampling)
    prepared = prepare_ensemble(sampled, EnsembleChoice(motion_seeds=2))
    first, second = (prepared.spread._inputs(number, 800.0) for number in (0, 1))
    assert np.array_equal(first.breakpoints, second.breakpoints)
    late = first.coefficients[:, -1, 0] != second.coefficients[:, -1, 0]
    assert late[4:].all()
    assert late[:2].all()
    assert not late[2:4].any()
    again = pickle.loads(pickle.dumps(prepared.ensemble))
    assert again.sampler._made == {}
    assert again.fingerprint() == prepared.ensemble.fingerprint()


def test_killed_command_goes_on_where_it_was(path, tmp_path, monkeypatch, unillustrated):
    monkeypatch.setattr("mrac_design.ensemble_study.preparation._LARGEST_CHUNK", 8)
    words = ("-s", path, "--duration", "1", "-n", "400", "--workers", "1")
    store = tmp_path / "store"
    process = subprocess.Popen(
        [sys.executable, "-c", SMALL_CHUNKS, *words, "--store", str(store)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    _wait_for(store, process, 5)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = {file: file.stat().st_mtime_ns for file in (store / "finished" / "c").iterdir()}
    assert 5 <= len(before) < 50
    run(*words, "--out", str(tmp_path / "plain"))
    text = run(*words, "--out", str(tmp_path / "resumed"), "--store", str(store))
    assert f"{len(before)} of 50 pieces were already kept" in text
    assert np.array_equal(table(tmp_path / "plain"), table(tmp_path / "resumed"))
    assert all(file.stat().st_mtime_ns == then for file, then in before.items())


def test_interrupted_command_says_how_to_go_on(path, tmp_path, monkeypatch):
    monkeypatch.setattr("mrac_design.ensemble_study.preparation._LARGEST_CHUNK", 8)

    class Impatient:
        def __init__(self, count):
            self.threads = LocalThreads(count=count)

        def results(self, ensemble, chunks):
            for number, item in enumerate(self.threads.results(ensemble, chunks)):
                if number == 2:
                    raise KeyboardInterrupt
                yield item

    words = ("-s", path, "-n", "40")
    store = ("--store", str(tmp_path / "e"))
    with monkeypatch.context() as patched:
        patched.setattr("mrac_design.simulation.ensemble.LocalThreads", Impatient)
        text = run(*words, *store, status=130)
        assert "give the same command to go on" in " ".join(text.split())
        assert "nothing was kept" in run(*words, status=130)
    assert "2 of 5 pieces were already kept" in run(*words, *store)


def test_local_cluster_gives_the_same_table(path, tmp_path, unillustrated):
    pytest.importorskip("distributed")
    words = ("-s", path, "-n", "60", "--workers", "1")
    run(*words, "--out", str(tmp_path / "threads"))
    run(*words, "--cluster", "local", "--out", str(tmp_path / "cluster"))
    assert np.array_equal(table(tmp_path / "threads"), table(tmp_path / "cluster"))


def test_mistakes_get_one_sentence(path, tmp_path):
    run("-s", path, "-n", "4", "--store", str(tmp_path / "e"))
    (tmp_path / "file").write_text("mine")
    base = load_scenario(path)
    save_scenario(replace(base, robot="d2m2_set_a"), tmp_path / "axes.toml")
    track = ROOT / "tests" / "no_such_track.csv"
    cases = [
        (("--store", str(tmp_path / "e"), "--seed", "1"), EnsembleError, "holds another ensemble"),
        (("--store", str(tmp_path / "file")), EnsembleError, "cannot be written"),
        (("--cluster", "tcp://127.0.0.1:9", "--workers", "1"), ParameterError, "leave it out"),
        (("--cluster", "nonsense://x"), ParameterError, "must be tcp://host:port"),
        (("--workers", "0"), ParameterError, "--workers = 0: must be at least 1"),
        (("--runs", "0"), ParameterError, "runs = 0"),
        (("--seed", "-1"), ParameterError, "seed = -1"),
        (("--variant", "best"), ParameterError, "must be one of frozen, adaptive"),
        (("--stiffness-range", "900", "100"), ParameterError, "stiffness range"),
        (("--gain-range", "0", "1"), ParameterError, "gain range"),
        (("--gain-range", "1", "2", "--variant", "frozen"), ParameterError, "nothing adapts"),
        (("--inertia-spread", "1"), ParameterError, "inertia spread"),
        (("--motion-seeds", "0"), ParameterError, "motion seeds"),
        (("--motion", str(track), "--motion-seeds", "2"), ParameterError, "has no seeds"),
        (("--step", "0"), ParameterError, "step"),
        (("--gain-range", "1e9", "1e9"), SimulationError, "smaller --step"),
        (("-s", str(tmp_path / "axes.toml")), ScenarioFileError, "controls force on X, Y, Z"),
        (("--out", str(tmp_path / "file")), FileError, "results cannot be written"),
    ]
    for words, kind, text in cases:
        with pytest.raises(kind) as problem:
            run("-s", path, "-n", "4", *words)
        assert text in str(problem.value), words
        assert "\n" not in str(problem.value)
    assert (tmp_path / "file").read_text() == "mine"


def test_cluster_that_is_not_there_is_one_sentence(path, monkeypatch):
    pytest.importorskip("distributed")
    from mrac_design.simulation import cluster

    soon = cluster.DaskCluster(address="tcp://127.0.0.1:9", timeout=0.5)
    monkeypatch.setattr(cluster, "DaskCluster", lambda address: replace(soon, address=address))
    with pytest.raises(EnsembleError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        run("-s", path, "-n", "4", "--cluster", "tcp://127.0.0.1:9")


def test_full_disk_is_one_sentence(path, tmp_path):
    """Files may not grow at all, which is what a full disk comes down to."""
    run("-s", path, "-n", "4")  # compiled and cached
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
        with pytest.raises(EnsembleError, match="cannot be written") as problem:
            run("-s", path, "-n", "4", "--store", str(tmp_path / "e"))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "\n" not in str(problem.value)


def test_bands_hold_equal_shares():
    stiffness = np.random.default_rng(0).permutation(np.arange(1.0, 101.0))
    centres, levels = stiffness_bands(stiffness, 2 * stiffness)
    assert centres == pytest.approx([10.5, 30.5, 50.5, 70.5, 90.5])
    assert levels[0] == pytest.approx(2 * centres)
    assert levels[2] == pytest.approx([40, 80, 120, 160, 200])


def test_picture_shows_every_axis(record):
    figure = ensemble_figure(record)
    assert len(figure.axes) == 4
    assert [ax.get_title(loc="left") for ax in figure.axes[2:]] == ["axis X", "axis Y"]
    for i, line in enumerate(figure.axes[0].lines):
        errors = 1e3 * record.metric("max_force_error")[:, i]
        assert line.get_xdata().max() == pytest.approx(errors.max())
        assert line.get_ydata().max() == 1.0
        assert line.get_ydata().min() == pytest.approx(1 / 60)
    assert "60 runs" in figure.caption


def _wait_for(store: Path, process: subprocess.Popen[bytes], count: int) -> None:
    end = time.monotonic() + 60
    while time.monotonic() < end and process.poll() is None:
        folder = store / "finished" / "c"
        if folder.is_dir() and len(list(folder.iterdir())) >= count:
            return
        time.sleep(0.005)
    raise AssertionError("the command ended before it could be stopped")
