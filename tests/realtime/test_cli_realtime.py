"""`mrac realtime`: tables for people, JSON for machines, one sentence for mistakes."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree

import pytest
import typer
from typer.testing import CliRunner

from mrac_design.cli.realtime import realtime
from mrac_design.errors import FileError, ParameterError
from mrac_design.export.c_expressions import DOUBLE, FLOAT
from mrac_design.simulation.scenario import save_scenario
from tests.realtime.small_scenario import small_scenario

APP = typer.Typer()
APP.command()(realtime)


@pytest.fixture
def finished(report, monkeypatch):
    """The command with its run already made: what it was asked for is kept."""
    asked = []

    def run_realtime(scenario, **choices):
        choices.pop("progress")("running", 0.5)
        asked.append((scenario, choices))
        return report

    monkeypatch.setattr("mrac_design.realtime.run_realtime", run_realtime)
    return asked


def run(*words: str) -> str:
    result = CliRunner().invoke(APP, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_runs_a_scenario_file_and_writes_its_results(uncounted, tmp_path):
    path, out = tmp_path / "small.toml", tmp_path / "deep" / "out"
    save_scenario(small_scenario(), path)
    words = ("-s", str(path), "--rates", "1000", "--duration", "0.05", "--out", str(out), "--json")
    values = json.loads(run(*words))
    (own,) = values["runs"]
    assert own["periods"] == 50
    assert own["torque"]["equal"]
    assert json.loads((out / "realtime.json").read_text()) == values
    assert ElementTree.parse(out / "latency.svg").getroot().tag.endswith("svg")
    assert (out / "latency.png").read_bytes()[1:4] == b"PNG"
    assert sorted(file.name for file in out.iterdir()) == [
        "latency.png",
        "latency.svg",
        "realtime.json",
    ]


def test_default_is_two_seconds_at_three_rates(finished, report):
    text = run()
    (scenario, choices), *_ = finished
    assert scenario.simulation.duration == 2.0
    assert choices == {"rates": [1000.0, 2000.0, 4000.0], "delay": None, "number": DOUBLE}
    assert "bit for bit" in text
    assert "real-time priority" in text
    assert f"measured on {report.machine}" in text
    for rate in ("1000", "1300"):
        assert f"\n{rate} Hz: torques" in text


def test_options_reach_the_run(finished):
    run(
        "--rates",
        "500,2500",
        "--duration",
        "0.25",
        "--delay",
        "0",
        "--gain",
        "0.5",
        "--real",
        "float",
    )
    ((scenario, choices),) = finished
    assert scenario.simulation.duration == 0.25
    assert scenario.adaptation.gain == 0.5
    assert choices == {"rates": [500.0, 2500.0], "delay": 0, "number": FLOAT}


def test_bad_rates_and_folders_get_one_sentence(finished, tmp_path):
    with pytest.raises(ParameterError, match="--rates = 1000;2000: must be numbers in Hz"):
        run("--rates", "1000;2000")
    (tmp_path / "file").write_text("mine")
    with pytest.raises(FileError, match="results cannot be written"):
        run("--out", str(tmp_path / "file"))
    assert (tmp_path / "file").read_text() == "mine"
