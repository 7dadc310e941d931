from __future__ import annotations

from dataclasses import replace

import pytest

from mrac_design.errors import MotionFileError, ParameterError, SimulationError, TuningError
from mrac_design.simulation import scenario_run
from mrac_design.simulation.compilation import find_compiler
from mrac_design.simulation.scenario import load_scenario
from mrac_design.study import run_study
from mrac_design.tuning import bench
from mrac_design.tuning.judging import judge, unseen_motions
from mrac_design.tuning.results import tuning_values, write_scenarios
from mrac_design.tuning.tuner import evaluate, tune
from tests.tuning.conftest import choice, small

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler here")


def test_better_than_the_start_and_within_the_constraints(record):
    assert record.tuned.worst < 0.9 * record.start.worst
    assert record.tuned.admissible(record.choice.delay_margin)
    assert not record.interrupted
    assert len(record.tried) <= record.choice.budget
    admissible = [p for p in record.tried if p.admissible(record.choice.delay_margin)]
    assert record.tuned.worst == min(point.worst for point in admissible)


def test_delay_margin_binds(record):
    asked = record.choice.delay_margin
    # The gain's three digits move the margin by less than half a percent.
    assert asked <= record.tuned.delay_margin < 1.005 * asked
    # Neighbours on either side in the gain: one breaks the constraint, the other is worse.
    k2, gain = record.tuned.values
    faster, slower = (
        evaluate(record.cases, record.choice.variables, (k2, gain * factor))
        for factor in (1.1, 0.9)
    )
    assert faster.worst < record.tuned.worst < slower.worst
    assert not faster.admissible(asked)
    looser = tune(choice(margin=0.85 * asked, budget=20))
    assert looser.tuned.worst < record.tuned.worst
    assert looser.tuned.delay_margin < asked


def test_integration_binds_without_a_delay_margin():
    free = tune(choice(free="gain", margin=0.0, budget=15)).tuned
    assert 0.9 < free.speed_share < 1


def test_same_seed_same_search(record):
    again = tune(choice())
    assert [p.values for p in again.tried] == [p.values for p in record.tried]
    assert again.tuned.worst == record.tuned.worst


def test_one_engine_for_all_evaluations(monkeypatch):
    built = []
    build = scenario_run.build_engine
    monkeypatch.setattr(
        scenario_run, "build_engine", lambda *a, **k: built.append(1) or build(*a, **k)
    )
    tune(choice(free="k2,gain,ao,alpha", budget=6))
    assert len(built) == 1


def test_interruption_keeps_the_best():
    seen = []

    def stop_at_nine(count, best):
        seen.append(best)
        if count == 9:
            raise KeyboardInterrupt

    record = tune(choice(), watch=stop_at_nine)
    assert record.interrupted
    assert len(record.tried) == 9
    assert record.tuned.worst == seen[-1] < seen[0]


def test_interruption_before_anything_is_known():
    def stop(count, best):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):  # the start leaves too little margin to be kept
        tune(choice(margin=1.1e-3), watch=stop)


def test_written_scenario_reproduces_the_figures(record, tmp_path):
    (path,) = write_scenarios(record, tmp_path / "deep")
    assert list((tmp_path / "deep").iterdir()) == [path]
    study = run_study(load_scenario(path))
    (case,) = record.tuned.cases
    tracked = study.tracking["adaptive_inverse"]
    assert {a: m.max_force_error_percent for a, m in tracked.items()} == case.errors
    assert study.max_torque["adaptive_inverse"] == case.torques
    head = path.read_text(encoding="utf-8").split("name =")[0]
    for said in ("delay margin >= 0.95 ms", "scenarios: stiffness", "heart_invivo_fit", "seed 0"):
        assert said in head


def test_a_recording_is_found_from_the_written_file(tmp_path, monkeypatch):
    rows = ["frame," + ",".join(f"p{k}_{a}_mm" for k in (1, 2) for a in "xyz")]
    rows += [f"{i}," + ",".join(str((i * 7 + j) % 5 / 10) for j in range(6)) for i in range(40)]
    (tmp_path / "heart.csv").write_text("\n".join(rows))
    monkeypatch.chdir(tmp_path)
    base = small()
    scenario = replace(base, motion=replace(base.motion, source="heart.csv", point="p1"))
    record = tune(choice(scenarios=(scenario,), budget=2, margin=0.0))
    (path,) = write_scenarios(record, tmp_path / "out")
    monkeypatch.chdir(tmp_path / "out")
    run = run_study(load_scenario("stiffness_tuned.toml"))
    errors = {a: m.max_force_error_percent for a, m in run.tracking["adaptive_inverse"].items()}
    assert errors == record.tuned.cases[0].errors
    assert "Motion tuned on: heart p1 (recorded)" in path.read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    point, model = unseen_motions(scenario, ("p2", "parametric"))
    assert (point.source, point.point, model.source) == ("heart.csv", "p2", "parametric")
    with pytest.raises(ParameterError, match="is the one tuned on"):
        unseen_motions(scenario, ("p1",))
    with pytest.raises(MotionFileError, match="p9"):
        unseen_motions(scenario, ("p9",))


def test_judged_on_what_it_never_saw(record):
    motions = unseen_motions(record.choice.scenarios[0], ())
    assert [motion.source for motion in motions] == ["parametric"]
    shares = []
    judgement = judge(record, motions, lambda message, share: shares.append(share))
    (unseen,) = judgement.unseen
    assert unseen.tuned.worst != record.tuned.worst
    assert unseen.tuned.delay_margin == record.tuned.delay_margin
    own = run_study(replace(small(), motion=motions[0])).tracking["adaptive_inverse"]
    assert unseen.start.cases[0].errors == {a: m.max_force_error_percent for a, m in own.items()}
    # RK4 at this step is far more accurate than the errors it is used to compare.
    assert judgement.step_effect < 1e-3 * record.tuned.worst
    assert {curve.k2 for curve in judgement.curves} == {0.0, 50.0, 100.0, record.tuned.values[0]}
    for curve in judgement.curves:
        assert curve.margins[0] > curve.margins[-1]
        assert curve.errors[0] > curve.errors[-1]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    values = tuning_values(record, judgement)
    assert values["unseen"]["parametric"]["tuned"]["worst_error_percent"] == unseen.tuned.worst


def test_several_scenarios_share_the_values():
    pair = (small("nominal"), small("stiffness"))
    record = tune(choice(scenarios=pair, budget=8))
    assert [s.name for s in record.scenarios] == ["nominal", "stiffness"]
    assert len({(s.design.velocity_gain, s.adaptation.gain) for s in record.scenarios}) == 1
    assert record.tuned.worst == max(case.worst for case in record.tuned.cases)
    assert record.tuned.delay_margin == record.tuned.cases[1].limits.delay_margin


def test_impossible_delay_margin():
    with pytest.raises(TuningError, match=r"10 ms cannot be had in stiffness: the largest found"):
        tune(choice(margin=10e-3))


def test_impossible_integration_step():
    base = small()
    coarse = replace(base, simulation=replace(base.simulation, step=0.01))
    with pytest.raises(TuningError, match="integration step is too long"):
        tune(choice(free="gain=1:2", scenarios=(coarse,)))


def test_impossible_torques():
    base = small()
    steps = tuple(replace(s, levels=(400.0, 600.0)) for s in base.reference.steps)
    hard = replace(base, reference=replace(base.reference, steps=steps))
    with pytest.raises(TuningError, match="keeps the motors below their torque limits"):
        tune(choice(scenarios=(hard,), budget=3, margin=0.0))


def test_every_run_lost(monkeypatch):
    def unstable(*arguments, **settings):
        raise SimulationError("the loop left the finite numbers")

    monkeypatch.setattr(bench, "simulate", unstable)
    with pytest.raises(TuningError, match="first because the loop left the finite numbers"):
        tune(choice(budget=2, margin=0.0))


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"scenarios": (small(), small())}, "all different"),
        ({"scenarios": ()}, "one or more"),
        ({"margin": -1.0}, "delay margin"),
        ({"budget": 1}, "at least 2"),
        ({"seed": -1}, "0 or more"),
    ],
)
def test_choices_that_are_none(changes, problem):
    with pytest.raises(ParameterError, match=problem):
        choice(**changes)


def test_only_the_normalised_law_has_alpha():
    base = small()
    plain = replace(base, adaptation=replace(base.adaptation, law="gradient"))
    with pytest.raises(ParameterError, match="only the normalised law"):
        choice(free="alpha", scenarios=(plain,))
