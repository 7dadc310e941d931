from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from mrac_design.cli.compare import compare
from mrac_design.errors import ParameterError
from mrac_design.report import comparison_report


@pytest.fixture
def runner():
    import typer

    app = typer.Typer()
    app.command()(compare)
    return lambda *arguments: CliRunner().invoke(app, list(arguments))


def test_finished_runs_are_written_up(runner, comparison, folder, monkeypatch):
    monkeypatch.setattr(comparison_report, "write_comparison_report", lambda *a, **k: comparison)
    shown = runner("--out", str(folder), "--budget", "4", "--seeds", "2")
    assert shown.exit_code == 0, shown.output
    assert "limit of linear control" in shown.output
    assert "NOT MET" in shown.output
    values = json.loads(runner("--out", str(folder), "--json").stdout)
    assert values["contestants"]["observer"]["features"]["linear"]


def test_unknown_controllers_are_named(runner, tmp_path):
    failed = runner("--out", str(tmp_path / "x"), "--only", "frozen,nobody")
    assert isinstance(failed.exception, ParameterError)
    assert not (tmp_path / "x").exists()
