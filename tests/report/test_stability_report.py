"""The stability report: written whole or not at all, numbers computed, certificates checked."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from mrac_design.assessment.choices import choices_path
from mrac_design.errors import CertificateError, NotebookError, ScenarioFileError
from mrac_design.report import stability_report
from mrac_design.report.stability_report import write_stability_report
from mrac_design.simulation.scenario import load_scenario
from mrac_design.verify import verify_certificate

SMALL = (
    ("box = 0.4", "box = 0.25"),
    ("bandwidths = [150.0, 200.0, 300.0, 500.0]", "bandwidths = [200.0, 500.0]"),
    ("rates = [1000.0, 1000.0, 2000.0, 4000.0]", "rates = [1000.0]"),
    ("delays = [0, 1, 1, 1]", "delays = [1]"),
    ("resolution = 0.05", "resolution = 0.25"),
    ("boxes = [0.1, 0.2, 0.3, 0.4]", "boxes = [0.2]"),
    ("points = 5", "points = 2"),
    ("paths = 60", "paths = 6"),
    ("spans = 160", "spans = 60"),
    ("runs = 24", "runs = 3"),
)
"""The packaged choices made quick."""


@pytest.fixture
def small(tmp_path):
    text = choices_path("paper").read_text()
    for old, new in SMALL:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "small.toml"
    path.write_text(text.replace('name = "paper"', 'name = "small"'))
    return path


@pytest.fixture
def short():
    scenario = load_scenario("nominal")
    return replace(scenario, simulation=replace(scenario.simulation, duration=5.0))


def test_whole_report(tmp_path, small, short):
    out = tmp_path / "reports" / "stability"
    report = write_stability_report(short, out, choices=str(small))
    assert {path.name for path in out.iterdir()} == {
        "certificate_continuous.json", "certificate_sampled.json", "report.html", "report.pdf",
        "scenario.toml", "stability.toml", "values.json",
    }  # fmt: skip
    assert all(verify_certificate(path).accepted for path in report.certificates)
    values = json.loads((out / "values.json").read_text())
    assert values == report.values
    assert values["theorem_5_9"] == "refuted"
    page = (out / "report.html").read_text()
    assert "<em>not</em> covered by Theorem 5.9" in page
    for design in values["designs"].values():
        assert design["verdict"] == "proved"
        assert f"{design['peak_gain_N_per_m_per_s2']:.3g} N" in page
        # One ratio a bound, each printed and none below one.
        assert len(design["bound_over_simulated"]) == 4
        for ratio in design["bound_over_simulated"].values():
            assert ratio >= 1
            assert f"{ratio:.3g}" in page
    assert "±25 %" in page  # the box asked for, not the packaged ±40 %
    assert load_scenario(out / "scenario.toml") == short


@pytest.mark.parametrize("stage", ["render_report", "verify_certificate"])
def test_failure_writes_nothing(tmp_path, short, small, monkeypatch, stage):
    def rendered(notebooks, **given):
        if stage == "render_report":
            raise NotebookError("x.py", "cell 1", "seeded")
        (given["html"].parent / "certificate_x.json").write_text("{}")

    monkeypatch.setattr(stability_report, "render_report", rendered)
    expected = NotebookError if stage == "render_report" else CertificateError
    with pytest.raises(expected):
        write_stability_report(short, tmp_path / "deep" / "out", choices=str(small))
    assert [path.name for path in tmp_path.iterdir()] == ["small.toml"]


def test_choices_are_read_before_anything_runs(tmp_path, short):
    with pytest.raises(ScenarioFileError, match="paper"):
        write_stability_report(short, tmp_path / "out", choices="no such choices")
