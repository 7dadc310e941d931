from __future__ import annotations

import json
import signal

import pytest
import typer
from typer.testing import CliRunner

from mrac_design.cli import tune as cli_tune
from mrac_design.errors import FileError, ParameterError, TuningError
from mrac_design.simulation.compilation import find_compiler
from mrac_design.simulation.scenario import load_scenario, save_scenario
from mrac_design.tuning.bench import Case
from tests.tuning.conftest import small

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler here")

APP = typer.Typer()
APP.command()(cli_tune.tune)


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "small.toml"
    save_scenario(small(), path)
    return str(path)


def run(*words: str, status: int = 0):
    result = CliRunner().invoke(APP, words)
    assert result.exit_code == status, result.output
    return result


def test_writes_scenario_numbers_and_picture(scenario, tmp_path):
    out = tmp_path / "deep" / "out"
    words = ("-s", scenario, "--delay-margin", "0.95e-3", "--free", "k2,gain,ao", "--budget", "8")
    values = json.loads(run(*words, "--out", str(out), "--json").stdout)
    written = json.loads((out / "tuning.json").read_text(encoding="utf-8"))
    assert values == {"out": str(out), **written}
    tuned = load_scenario(out / "stiffness_tuned.toml")
    assert tuned.design.observer_pole == written["tuned"]["values"]["ao"]
    assert written["evaluations"] == 8
    assert (out / "figures" / "trade_off.png").read_bytes()[1:4] == b"PNG"
    assert "<svg" in (out / "figures" / "trade_off.svg").read_text(encoding="utf-8")


def test_interrupted_it_writes_the_best_so_far(scenario, tmp_path, monkeypatch):
    runs, result = [], Case.result

    def stopped_in_the_third(self, variables, values):
        runs.append(values)
        if len(runs) == 4:  # the first is the scenario as given
            signal.raise_signal(signal.SIGINT)
        return result(self, variables, values)

    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr(Case, "result", stopped_in_the_third)
    out = tmp_path / "out"
    words = ("-s", scenario, "--delay-margin", "0.5e-3", "--out", str(out))
    told = run(*words, status=130)
    assert "tuned: K2" in told.output
    values = json.loads((out / "tuning.json").read_text(encoding="utf-8"))
    assert values["interrupted"]
    assert values["unseen"] == {}
    chosen = load_scenario(out / "stiffness_tuned.toml")
    assert (chosen.design.velocity_gain, chosen.adaptation.gain) in runs[1:]
    assert (len(runs), values["evaluations"]) == (4, 3)
    assert signal.getsignal(signal.SIGINT) is before


def test_prints_start_and_tuned(scenario, tmp_path):
    words = ("-s", scenario, "--delay-margin", "0.95e-3", "--budget", "2")
    shown = run(*words, "--out", str(tmp_path / "out")).output
    for said in ("scenario", "stiffness", "parametric", "0.95 ms asked for", "half the step"):
        assert said in shown


@pytest.mark.parametrize(
    ("words", "error", "problem"),
    [
        (("--delay-margin", "0.05"), TuningError, "cannot be had"),
        (("--delay-margin", "1e-3", "--free", "k3"), ParameterError, "'k3' is none of"),
        (("--delay-margin", "1e-3", "--unseen", "p1"), ParameterError, "needs a recording"),
    ],
)
def test_mistakes_leave_nothing_behind(scenario, tmp_path, words, error, problem):
    out = tmp_path / "out"
    result = run("-s", scenario, *words, "--out", str(out), status=1)
    assert isinstance(result.exception, error)
    assert problem in str(result.exception)
    assert not out.exists()


def test_a_folder_that_is_a_file(scenario, tmp_path):
    (tmp_path / "out").write_text("")
    words = ("-s", scenario, "--delay-margin", "0", "--budget", "2", "--out", str(tmp_path / "out"))
    result = run(*words, status=1)
    assert isinstance(result.exception, FileError)


def test_the_delay_margin_has_no_default(scenario):
    assert "--delay-margin" in run("-s", scenario, status=2).output
