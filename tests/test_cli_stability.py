"""`mrac stability` hands its options on and prints what was found."""

from __future__ import annotations

import json

import pytest
import typer
from typer.testing import CliRunner

from mrac_design.cli.certify import stability
from mrac_design.errors import ParameterError
from mrac_design.report import stability_report
from mrac_design.report.stability_report import StabilityReport, write_stability_report
from mrac_design.simulation.scenario import load_scenario


@pytest.fixture
def seen(monkeypatch, tmp_path):
    given = {}

    def written(scenario, out, *, choices, progress):
        progress("running", 0.5)
        given.update(scenario=scenario, out=out, choices=choices)
        values = {
            "theorem_5_9": "refuted",
            "designs": {
                "sampled": {
                    "verdict": "proved",
                    "box": 0.2,
                    "bound_over_simulated": {"peak force per peak of $d$": 1.74},
                }
            },
        }
        return StabilityReport(
            folder=out, certificates=(out / "certificate_x.json",), values=values
        )

    monkeypatch.setattr(stability_report, "write_stability_report", written)
    return given


def run(*arguments):
    app = typer.Typer()
    app.command()(stability)
    return CliRunner().invoke(app, list(arguments))


def test_options_reach_the_report_and_numbers_the_user(seen, tmp_path):
    result = run("--omega", "300", "--out", str(tmp_path / "r"), "--choices", "mine.toml")
    assert result.exit_code == 0, result.output
    assert seen["scenario"].design.bandwidth == 300.0
    assert (seen["choices"], seen["out"]) == ("mine.toml", tmp_path / "r")
    assert "feedforward theorem: refuted" in result.output
    assert "sampled, gains within ±20 %: proved" in result.output
    assert "peak force per peak of d: bound over simulated 1.74" in result.output


def test_json_for_machines(seen):
    result = run("--json")
    assert json.loads(result.stdout)["theorem_5_9"] == "refuted"


def test_a_design_with_an_internal_model_is_told_where_its_proof_is(tmp_path):
    with pytest.raises(ParameterError, match="mrac certify -s reality"):
        write_stability_report(load_scenario("reality"), tmp_path / "out")
    assert not (tmp_path / "out").exists()
