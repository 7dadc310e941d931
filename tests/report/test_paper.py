"""The simulations of [Z]: what counts as one, what is said of them, and the whole report."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from mrac_design.design import ReferenceModel
from mrac_design.errors import MotionFileError, NotebookError, ParameterError
from mrac_design.report import paper_report
from mrac_design.report.figures_paper import positions_figure
from mrac_design.report.findings_paper import findings
from mrac_design.report.paper import (
    PaperStudy,
    paper_error,
    paper_figure,
    paper_scenarios,
    paper_simulation,
    run_paper,
)
from mrac_design.report.paper_report import read_paper_scenarios, write_paper_report
from mrac_design.report.provenance import scenario_provenance
from mrac_design.report.tables_paper import summary_table
from mrac_design.simulation.scenario import load_scenario


@pytest.fixture(scope="module")
def nominal():
    return load_scenario("nominal")


@pytest.fixture(scope="module")
def studies():
    return run_paper(paper_scenarios())


def number(scenario):
    simulation = paper_simulation(scenario)
    return None if simulation is None else simulation.number


def test_conditions_count_and_not_the_name(nominal):
    assert [number(scenario) for scenario in paper_scenarios()] == [1, 2, 3]
    assert number(replace(nominal, stiffness=1200.0)) == 3
    assert number(replace(nominal, stiffness=1000.0)) is None
    # What [Z] leaves open may be anything.
    free = replace(
        nominal,
        name="mine",
        robot="d2m2_set_b",
        motion=replace(nominal.motion, source="heart_parametric"),
        design=replace(nominal.design, velocity_gain=0.0).with_observer_pole(300.0),
        adaptation=replace(nominal.adaptation, gain=2.0),
    )
    assert number(free) == 1


@pytest.mark.parametrize("name", ["reality", "loss_of_contact", "stiffness_step", "saturation"])
def test_other_scenarios_are_no_simulation_of_the_paper(name):
    assert number(load_scenario(name)) is None


@pytest.mark.parametrize(
    "change",
    [
        {"prefilter": ReferenceModel(bandwidth=40.0, damping=1.0)},
        {"friction": replace(load_scenario("nominal").friction, scale=1.0)},
        {"contact": replace(load_scenario("nominal").contact, damping=1.0)},
        {"design": replace(load_scenario("nominal").design, bandwidth=400.0)},
        {"adaptation": replace(load_scenario("nominal").adaptation, bias_force=1.0)},
    ],
)
def test_what_the_paper_states_may_not_differ(nominal, change):
    assert number(replace(nominal, **change)) is None


def test_runs_refuse_scenarios_that_are_not_the_papers(nominal):
    with pytest.raises(ParameterError, match="conditions of simulation 2"):
        run_paper([nominal, nominal, nominal])


def test_paper_numbers_of_figures_and_errors(studies):
    keys = ("heart motion", "force X", "force Y", "force Z", "positions", "torques")
    shown = ["".join(paper_figure(item.study, key) for key in keys) for item in studies]
    numbered = [
        [int(word.rstrip(")")) for word in text.split() if word[0].isdigit()] for text in shown
    ]
    assert numbered == [[5, 6, 7, 8, 9, 10], [11], [12, 13]]
    # [Z]: about 3 % on every axis, then 5.3, 2 and 2 %, then none.
    stated = [[paper_error(item.simulation, axis) for axis in "XYZ"] for item in studies]
    no_break = "\N{NO-BREAK SPACE}"
    assert stated[0] == [f"≈{no_break}3{no_break}%"] * 3
    assert stated[1:] == [[f"5.3{no_break}%", f"2{no_break}%", f"2{no_break}%"], ["–"] * 3]


def provenance(study):
    return {row[0]: row[1:] for row in scenario_provenance(study).rows}


def test_provenance_tells_the_papers_values_from_assumed_ones(studies):
    first, second, third = (provenance(item.study) for item in studies)
    assert first["true stiffness $K_s$"] == ("800 N/m", "published", "simulation 1 of [Z]")
    assert third["true stiffness $K_s$"] == ("1200 N/m", "published", "simulation 3 of [Z]")
    assert first["controller's robot model"][:2] == ("perfect", "published")
    assert "× 1.05, first joint × 1.25" in second["controller's robot model"][0]
    assert first["friction of the joints"][0] == "none"
    assert first["sampling"][1] == "published"


def test_provenance_names_what_a_sampled_robot_meets(studies):
    scenario = load_scenario("stiffness_step")
    choice = replace(scenario.contact, damping=2.0)
    table = provenance(replace(studies[0].study, scenario=replace(scenario, contact=choice)))
    assert table["sampling"][0] == "1000 Hz, 1 sample(s) of delay"
    assert table["force sensor"][0] == "noise 5 mN, steps of 5 mN"
    assert table["joint sensors"][0].startswith("1048576 counts a turn")
    assert table["friction of the joints"][0].startswith("1 × the robot file's")
    assert table["contact"][0].startswith("one-sided")
    assert table["damping of the tissue"][0] == "2 N·s/m"
    assert table["factor on $K_s$"][0] == "1 from 0 s, 1.5 from 1 s, 1 from 3 s"
    assert table["safeguards of the law"][0].startswith("leakage (rate 0.2), projection")
    measured = ("sampling", "force sensor", "joint sensors", "friction of the joints", "contact")
    assert {table[name][1] for name in measured} == {"assumed"}


def test_summary_is_that_of_the_trajectories(studies):
    table = summary_table(studies)
    assert len(table.rows) == 9
    for i, item in enumerate(studies):
        study = item.study
        settling = study.scenario.simulation.settling
        for column, name in enumerate(study.trajectories):
            run = study.trajectories[name]
            kept = run.time >= settling
            error = np.abs(run["force"] - run["desired_force"])[kept].max(axis=0)
            percent = 100 * error / np.abs(run["desired_force"]).max(axis=0)
            rms = np.sqrt(np.mean((run["force"] - run["model_force"])[kept] ** 2, axis=0))
            for axis in range(3):
                row = table.rows[3 * i + axis]
                assert row[3 + column] == f"{percent[axis]:.3g} %"
                assert row[6 + column] == f"{1e3 * rms[axis]:.3g}"
        limits = study.robot.motor_torque_limits
        share = max(np.abs(run["torque"] / limits).max() for run in study.trajectories.values())
        assert table.rows[3 * i][9] == f"{100 * share:.1f} %"


def test_position_errors_are_force_errors_over_the_stiffness(studies):
    for item in studies:
        study = item.study
        right = positions_figure(study).axes[1::2]
        for axis, ax in enumerate(right):
            for drawn, run in zip(ax.lines, study.trajectories.values(), strict=True):
                force = (run["force"] - run["desired_force"])[:, axis] / study.scenario.stiffness
                # Thinning keeps the extremes; millimetres less half a metre lose 1e-10 µm.
                assert np.abs(drawn.get_ydata()).max() == pytest.approx(
                    1e6 * np.abs(force).max(), abs=1e-6
                )


def scaled(item, variant, factor):
    """The same study with a variant's largest errors multiplied."""
    tracking = {name: dict(axes) for name, axes in item.study.tracking.items()}
    for axis, metrics in tracking[variant].items():
        percent = factor * metrics.max_force_error_percent
        tracking[variant][axis] = replace(metrics, max_force_error_percent=percent)
    return PaperStudy(simulation=item.simulation, study=replace(item.study, tracking=tracking))


def test_the_verdict_on_the_stiffness_test_follows_the_runs(studies):
    assert "passes the stiffness test of [Z] as well" in findings(studies)[0]
    worse = [studies[0], studies[1], scaled(studies[2], "frozen", 2.0)]
    assert "does lose more" in findings(worse)[0]


def test_the_verdict_on_the_lag_follows_the_runs(studies):
    assert "because most of it is the lag" in findings(studies)[1]
    worse = [scaled(studies[0], "adaptive", 3.0), *studies[1:]]
    assert "part of which is the lag" in findings(worse)[1]


def test_the_rise_of_the_paper_counts_as_reproduced_only_if_it_is(studies):
    assert "is not reproduced" in findings(studies)[-1]
    risen = [studies[0], scaled(studies[1], "adaptive", 1.8), studies[2]]
    assert "is not reproduced" not in findings(risen)[-1]


def test_whole_report(tmp_path, studies):
    """Runs the notebook, and with it the assertions it ends with."""
    out = tmp_path / "reports" / "paper"
    out.mkdir(parents=True)
    (out / "mine.txt").write_text("keep")
    values = write_paper_report(paper_scenarios(), out)
    assert {path.name for path in out.iterdir()} == {
        "figures", "gains.json", "mine.txt", "report.html", "report.pdf", "scenarios",
        "values.json",
    }  # fmt: skip
    assert [path.name for path in out.parent.iterdir()] == ["paper"]
    assert values == json.loads((out / "values.json").read_text())
    assert read_paper_scenarios(out / "scenarios") == paper_scenarios()
    assert json.loads((out / "gains.json").read_text())["gains"]
    figures = sorted(path.name for path in (out / "figures").glob("*.png"))
    assert [int(name.split("_")[1]) for name in figures] == list(range(5, 14))

    page = (out / "report.html").read_text()
    assert [n for n in range(1, 20) if f"[Z] figure {n})" in page] == list(range(5, 14))
    for entry, item in zip(values["simulations"], studies, strict=True):
        assert entry["paper"]["number"] == item.simulation.number
        for variant, axes in item.study.tracking.items():
            for axis, metrics in axes.items():
                # The notebook has simulated in a process of its own: same numbers.
                shown = entry["metrics"][variant][axis]["max_force_error_percent"]
                assert shown == metrics.max_force_error_percent
                assert f"{shown:.3g} %" in page


@pytest.mark.parametrize(
    "failure", [NotebookError("x.py", "cell 1", "seeded"), KeyboardInterrupt()]
)
def test_failure_or_interruption_writes_nothing(tmp_path, monkeypatch, failure):
    def fail(*_, **__):
        raise failure

    monkeypatch.setattr(paper_report, "render_report", fail)
    with pytest.raises(type(failure)):
        write_paper_report(paper_scenarios(), tmp_path / "deep" / "out")
    assert list(tmp_path.iterdir()) == []


def test_a_bad_motion_is_told_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(paper_report, "render_report", None)
    missing = [
        replace(scenario, motion=replace(scenario.motion, source="nowhere.csv"))
        for scenario in paper_scenarios()
    ]
    with pytest.raises(MotionFileError, match=r"nowhere\.csv"):
        write_paper_report(missing, tmp_path / "out")
