from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from mrac_design.comparison import (
    ComparisonStore,
    comparison_specification,
    comparison_values,
    load_specification,
    pareto_front,
    ranking,
    run_comparison,
    save_specification,
)
from mrac_design.comparison import comparison as module
from mrac_design.comparison.findings import certified, claims, difference, findings, measured_under
from mrac_design.comparison.judging import Judgement, Measured
from mrac_design.comparison.store import Entry
from mrac_design.errors import FileError, ParameterError
from mrac_design.report.comparison_report import FIGURES, write_comparison_report
from mrac_design.report.tables_comparison import claim_table, feature_table, rms_table
from mrac_design.simulation.scenario import load_scenario


def faked(comparison, **errors):
    """The comparison with other numbers: name → (rms mN, motion mN, amplification)."""
    entries = {}
    for name, (rms, motion, amplification) in errors.items():
        measured = Measured(
            rms=1e-3 * np.array([rms - 0.01, rms + 0.01]), largest=np.full(2, 4e-3 * rms)
        )
        conditions = {c.name: measured for c in comparison.conditions.judged}
        entries[name] = Entry(
            tuning=comparison.entries[name].tuning,
            judgement=Judgement(
                conditions=conditions, motion_error=1e-3 * motion, amplification=amplification
            ),
        )
    return replace(comparison, entries=entries)


def test_everyone_had_the_same(comparison):
    assert {e.tuning.evaluations for e in comparison.entries.values()} == {4}
    for entry in comparison.entries.values():
        assert {m.rms.size for m in entry.judgement.conditions.values()} == {2}


def test_no_linear_contestant_is_below_the_limit_on_its_motion(comparison):
    for contestant in comparison.contestants:
        if contestant.features.linear:
            measured = measured_under(comparison, contestant.name, "random")
            assert measured.mean > comparison.limits["random"].error


def test_finished_contestants_are_not_run_again(comparison, specification, folder, monkeypatch):
    def nothing(specification, missing, *rest):
        assert not missing, "computed again"
        return ()

    monkeypatch.setattr(module, "_computed_in_processes", nothing)
    again = run_comparison(specification, store=ComparisonStore(folder / "runs"))
    for name, entry in comparison.entries.items():
        other = again.entries[name]
        assert np.array_equal(entry.tuning.values, other.tuning.values)
        for condition, measured in entry.judgement.conditions.items():
            assert np.array_equal(measured.rms, other.judgement.conditions[condition].rms)


def test_another_question_is_not_answered_from_the_store(specification, folder):
    store = ComparisonStore(folder / "runs")
    contestant = specification.contestants[0]
    assert store.read(contestant.name, specification.fingerprint(contestant)) is not None
    for change in ({"budget": 5}, {"seeds": 3}, {"axis": "X"}):
        other = replace(specification, **change)
        assert store.read(contestant.name, other.fingerprint(contestant)) is None


def test_a_damaged_file_is_computed_anew(specification, tmp_path):
    (tmp_path / "frozen.json").write_text("{ half a fi")
    contestant = specification.contestants[0]
    assert ComparisonStore(tmp_path).read("frozen", specification.fingerprint(contestant)) is None


def test_a_specification_survives_its_file(specification, tmp_path):
    path = tmp_path / "comparison.json"
    save_specification(specification, path)
    assert load_specification(path) == specification
    path.write_text("{}")
    with pytest.raises(FileError, match="no specification"):
        load_specification(path)


def test_unknown_names_and_continuous_scenarios_are_refused():
    with pytest.raises(ParameterError, match=r"nobody.*must be one of frozen"):
        comparison_specification(load_scenario("reality"), taking_part=("nobody",))
    with pytest.raises(ParameterError, match="sampled"):
        comparison_specification(load_scenario("nominal"))


def test_the_front_is_unbeaten(comparison):
    three = faked(
        comparison,
        frozen_inverse=(6.0, 4.0, 0.6),
        mrac_inverse=(5.0, 3.0, 0.7),
        observer=(4.0, 3.5, 0.8),
    )
    assert [c.name for c in pareto_front(three)] == ["frozen_inverse", "mrac_inverse"]
    assert [c.name for c in ranking(three, "held_back")] == [
        "observer", "mrac_inverse", "frozen_inverse",
    ]  # fmt: skip


def test_sentences_follow_the_numbers(comparison):
    better = faked(
        comparison,
        frozen_inverse=(6.0, 4.0, 0.9),
        mrac_inverse=(3.0, 2.0, 0.7),
        observer=(4.0, 3.5, 0.8),
    )
    worse = faked(
        comparison,
        frozen_inverse=(6.0, 4.0, 0.9),
        mrac_inverse=(7.0, 5.0, 0.95),
        observer=(4.0, 3.5, 0.8),
    )
    said, other = "\n".join(findings(better)), "\n".join(findings(worse))
    assert "MRAC + inverse has the smallest error" in said
    assert "over frozen RST + inverse**, gains under" in said
    assert "active observer, order 1 has the smallest error" in other
    assert "No adaptive controller is among them" in other
    assert "over frozen RST + inverse**, costs under" in other
    front = {claim.text: claim.met for claim in claims(better)}
    assert front["an adaptive RST controller lies on the front of motion error and amplification"]
    # Below the limit on its own motion no linear controller can be: such numbers are refused.
    impossible = faked(
        comparison, frozen_inverse=(1.0, 1.0, 0.1), mrac_inverse=(5, 5, 1), observer=(4, 4, 1)
    )
    assert not claims(impossible)[-1].met


def test_differences_are_paired(comparison):
    gap = difference(comparison, "observer", "observer", "held_back")
    assert gap.mean == gap.half_width == 0.0
    assert not gap.decided


def test_who_claims_no_proof_is_not_certified(comparison):
    assert certified(comparison) == ()
    assert not claims(comparison)[0].met


def test_values_are_plain_data(comparison):
    values = json.loads(json.dumps(comparison_values(comparison), allow_nan=False))
    assert set(values["contestants"]) == {"frozen_inverse", "mrac_inverse", "observer"}
    own = values["contestants"]["observer"]
    assert own["mean_rms_N"]["held_back"]["mean"] == pytest.approx(
        np.mean(own["conditions"]["held_back"]["rms_N"]), rel=1e-12
    )


def test_tables_and_figures_show_everyone(comparison):
    for table in (feature_table(comparison), rms_table(comparison)):
        shown = table._repr_markdown_()
        assert all(contestant.title in shown for contestant in comparison.contestants)
    assert "no" in claim_table(comparison)._repr_markdown_()
    for factory in FIGURES.values():
        figure = factory(comparison)
        assert figure.caption
        assert len(figure.svg()) > 5000


def test_the_report_is_written_from_finished_runs(specification, folder):
    messages = []
    write_comparison_report(
        specification, folder, progress=lambda message, share: messages.append((message, share))
    )
    shares = [share for _, share in messages]
    assert shares[-1] == pytest.approx(1.0)
    assert (folder / "report.pdf").read_bytes().startswith(b"%PDF")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "All checks passed." in page
    assert "active observer, order 1" in page
    assert {path.name for path in folder.iterdir()} == {
        "report.html", "report.pdf", "values.json", "comparison.json", "figures", "runs",
    }  # fmt: skip
