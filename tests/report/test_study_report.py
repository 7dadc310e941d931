from __future__ import annotations

import json
from dataclasses import replace

import pytest

from mrac_design.errors import MracDesignError, NotebookError
from mrac_design.report import gains_figure, study_report
from mrac_design.report.execution import execute_notebooks
from mrac_design.report.study_report import REPORT_NOTEBOOKS, write_study_report
from mrac_design.resources import notebooks_directory
from mrac_design.simulation.scenario import load_scenario, save_scenario
from mrac_design.study import run_study

FILES = {
    "figures",
    "gains.json",
    "report.html",
    "report.pdf",
    "scenario.toml",
    "values.json",
}


@pytest.fixture(scope="module")
def nominal():
    return load_scenario("nominal")


def test_whole_report_of_the_packaged_scenario(tmp_path, nominal):
    """Runs every notebook of the report, and with them the assertions they end with."""
    out = tmp_path / "reports" / "nominal"
    out.mkdir(parents=True)
    (out / "mine.txt").write_text("keep")
    fractions = []
    study = write_study_report(nominal, out, progress=lambda _, done: fractions.append(done))
    assert {path.name for path in out.iterdir()} == FILES | {"mine.txt"}
    assert [path.name for path in out.parent.iterdir()] == ["nominal"]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0

    values = json.loads((out / "values.json").read_text())
    page = (out / "report.html").read_text()
    for axis in study.robot.force_axes:
        shown = values["metrics"]["adaptive_inverse"][axis]["max_force_error_percent"]
        assert shown == study.tracking["adaptive_inverse"][axis].max_force_error_percent
        # The notebook has simulated anew, in a process of its own: same numbers.
        assert f"{shown:.3g} %" in page
    assert load_scenario(out / "scenario.toml") == nominal
    for number in range(5, 11):
        assert f"figure {number})" in page
    assert len(list((out / "figures").glob("figure_*.png"))) == 6


def test_design_panel_notebook_runs(tmp_path):
    pytest.importorskip("ipywidgets")
    path = notebooks_directory() / "04_design_panel.py"
    (notebook,) = execute_notebooks([path], tmp_path, {}, lambda name, done: None)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    # Streams carry no data: without a compiler the engine says so.
    shown = [output.data for output in outputs if "data" in output]
    assert any("application/vnd.jupyter.widget-view+json" in data for data in shown)


def test_paths_given_from_the_working_folder_reach_the_notebooks(tmp_path, nominal, monkeypatch):
    """The notebooks run elsewhere, so a relative path has to be made absolute first."""
    monkeypatch.chdir(tmp_path)
    robot = tmp_path / "my_robot.toml"
    robot.write_text((notebooks_directory().parent / "models/robots/d2m2_set_a.toml").read_text())
    seen = {}
    monkeypatch.setattr(study_report, "save_figures", lambda _, folder: folder.mkdir())
    monkeypatch.setattr(study_report, "REPORT_NOTEBOOKS", ())
    monkeypatch.setattr(
        study_report,
        "render_report",
        lambda notebooks, **given: seen.update(scenario=given["scenario"].read_text()),
    )
    short = replace(nominal.simulation, duration=0.6)
    write_study_report(replace(nominal, robot="my_robot.toml", simulation=short), tmp_path / "out")
    assert f'robot = "{robot}"' in seen["scenario"]


@pytest.mark.parametrize("stage", ["run_study", "render_report", "save_figures"])
def test_failure_at_any_stage_writes_nothing(tmp_path, nominal, monkeypatch, stage):
    def fail(*_, **__):
        raise NotebookError("x.py", "cell 1", "seeded")

    monkeypatch.setattr(study_report, stage, fail)
    monkeypatch.setattr(study_report, "REPORT_NOTEBOOKS", REPORT_NOTEBOOKS[:0])
    short = replace(nominal, simulation=replace(nominal.simulation, duration=0.6))
    if stage == "render_report":
        monkeypatch.setattr(study_report, "save_figures", lambda _, folder: folder.mkdir())
    with pytest.raises(MracDesignError, match="seeded"):
        write_study_report(short, tmp_path / "deep" / "out")
    assert list(tmp_path.iterdir()) == []


def test_simulation_chapter_knows_tissue_that_steps_and_damps(tmp_path):
    """The chapter ends with the force recomputed from positions and velocities."""
    scenario = load_scenario("stiffness_step")
    short = replace(
        scenario,
        contact=replace(scenario.contact, damping=2.0),
        simulation=replace(scenario.simulation, duration=1.2),  # past the first step, at 1 s
    )
    save_scenario(short, tmp_path / "scenario.toml")
    environment = {"MRAC_SCENARIO": str(tmp_path / "scenario.toml")}
    path = notebooks_directory() / "03_nominal.py"
    (notebook,) = execute_notebooks([path], tmp_path, environment, lambda name, done: None)
    shown = "".join(str(cell.get("outputs", "")) for cell in notebook.cells)
    assert "All checks passed." in shown
    assert "[Z] has no simulation under these conditions" in shown
    assert "[Z] figure" not in shown


def test_gains_figure_leaves_out_what_does_not_move(nominal):
    step = nominal.reference.steps[0].times[1]
    short = replace(nominal.simulation, duration=step + 0.2)
    study = run_study(replace(nominal, simulation=short))
    assert all(not ax.get_lines() for ax in gains_figure(study, "frozen").axes)
    x, y, _ = gains_figure(study).axes
    assert [line.get_label() for line in x.get_lines()] == ["r1'", "s0", "s1", "t0", "t1"]
    # On Y no step has come yet, so the gain of the reference's derivative has not moved.
    assert [line.get_label() for line in y.get_lines()] == ["r1'", "s0", "s1", "t1"]
    colours = {line.get_label(): line.get_color() for line in x.get_lines()}
    assert all(line.get_color() == colours[line.get_label()] for line in y.get_lines())
