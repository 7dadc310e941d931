"""Drift of the gains: whether noise moves them, what holds them, where the poles then are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from mrac_design.cli.drift import drift
from mrac_design.comparison.drift import DriftBench, drift_runs
from mrac_design.comparison.drift_cases import (
    GUARDED,
    PLAIN,
    REST_AND_WORK,
    STILL,
    DriftCase,
    guarded_cases,
)
from mrac_design.comparison.drift_findings import (
    MOST_DELAY,
    borne_delay,
    drift_values,
    frozen_growth,
    summary,
)
from mrac_design.errors import ParameterError
from mrac_design.report.figures_drift import drift_figure, path_figure
from mrac_design.simulation.safeguards import Leakage
from mrac_design.simulation.scenario import load_scenario
from tests.oracles import sampled_force_loop as oracle

FAST = "parametric_fast"
SWIFT = 2.0
"""γ̂ that drifts in minutes as far as the scenario's own does in half an hour."""


@pytest.fixture(scope="module")
def bench():
    return DriftBench(scenario=load_scenario("reality_degree_one"))


def resting(law=PLAIN, motion=STILL, force=0.0):
    return DriftCase(law=law, motion=motion, programme=replace(REST_AND_WORK, rest=force, work=0))


@pytest.fixture(scope="module")
def cycles(bench):
    """Two minutes of rest and one of work, twice, under the fast assumed motion."""
    programme = replace(REST_AND_WORK, cycle=3)
    return {
        run.case.law.name: run for run in drift_runs(bench, guarded_cases([FAST], programme), 6)
    }


def test_only_the_plain_law_bursts_after_a_rest(bench, cycles):
    plain, *guarded = (summary(bench, cycles[law.name]) for law in (PLAIN, *GUARDED))
    assert plain.largest > 0.4  # N; 0.53 with these seeds, and lost within half an hour
    assert plain.strayed > 1.5
    for found in guarded:
        assert found.lost is None
        assert found.strayed < 1.0
        assert found.growth < 1.0
        assert found.largest < 0.3


def test_a_leakage_too_slow_for_the_motion_does_not_hold(bench, cycles):
    """The strength of the safeguard decides, not its name."""
    weak = replace(PLAIN, name="weak", safeguards=(Leakage(rate=0.1),))
    case = replace(cycles["plain"].case, law=weak)
    assert summary(bench, bench.run(case, 3)).largest > 2 * cycles["leakage"].largest[1:].max()


def test_the_mean_drift_grows_with_the_variance_and_keeps_its_direction(bench):
    """So where it ends does not depend on how loud the noise is, only when."""
    sampling, found = bench.scenario.sampling, []
    for noise in (5e-3, 20e-3):
        sensor = replace(sampling.force_sensor, noise=noise, resolution=1e-6)
        scenario = replace(bench.scenario, sampling=replace(sampling, force_sensor=sensor))
        gains = [*bench.nominal[:3] + np.array([0.2, -0.3, -0.1]), *bench.nominal[3:]]
        found.append(DriftBench(scenario=scenario).averaged_drift(resting(), gains))
    # The same draws, four times as large; |φ̂|² is up to 1e-3 of α in the norm.
    assert found[1] / 16 == pytest.approx(found[0], rel=2e-2, abs=1e-3 * np.abs(found[0]).max())
    assert np.linalg.norm(found[0]) > 0


def test_on_a_still_heart_the_drift_ends_where_the_force_is_no_longer_heard(bench):
    run = bench.run(resting(), 10, gain=SWIFT)
    found = summary(bench, run)
    assert abs(run.gains[-1][2]) < 0.03  # s1, which began at 0.30
    # The walk along the edge is as wide as adaptation is fast: 1e-2 at this γ̂.
    assert 0.99 < frozen_growth(bench, run.gains[-1]) < 1.01
    assert found.bears <= 0 < borne_delay(bench, bench.nominal)


def test_the_mean_drift_all_but_ends_where_the_gains_stop(bench):
    case = resting(motion="parametric")
    run = bench.run(case, 6, gain=SWIFT)
    ends = (bench.nominal, run.gains[-1])
    first, last = (np.linalg.norm(bench.averaged_drift(case, gains)) for gains in ends)
    assert last < 0.05 * first


@pytest.mark.parametrize("extra", [0, 1])
def test_poles_are_those_of_the_loop_written_out(bench, extra):
    """The same loop from closed-form exponentials, u = −θᵀ(P1φ) with the filters held exactly."""
    design, ao, h = bench.design, bench.design.specification.observer_pole, 1e-3
    gains = np.array([2.5, 1.4, 0.2])
    r, s0, s1 = design.scaling[:3] * gains
    b, f = np.exp(-ao * h), (1.0 - np.exp(-ao * h)) / ao
    # States xu, xy; columns: state, force, reference, applied command.
    rows = np.array([[b, 0.0, 0.0, 0.0, f], [0.0, b, f, 0.0, 0.0]])
    command = np.array([-r, s0 * ao - s1, -s0, 0.0, 0.0])
    phi, gamma = oracle.plant(bench.scenario.stiffness, 0.0, h)
    poles = np.linalg.eigvals(oracle.closed_matrix(rows, command, phi, gamma, 1 + extra))
    assert frozen_growth(bench, gains, extra_delay=extra) == pytest.approx(
        np.abs(poles).max(), rel=1e-9
    )


def test_borne_delay_is_the_last_stable_one(bench):
    bears = borne_delay(bench, bench.nominal)
    assert frozen_growth(bench, bench.nominal, extra_delay=bears) < 1.0
    assert bears == MOST_DELAY - 1 or (
        frozen_growth(bench, bench.nominal, extra_delay=bears + 1) >= 1.0
    )
    assert borne_delay(bench, [2.5, 1.4, -0.2]) == -1


def test_values_are_plain_and_hold_every_minute(bench, cycles):
    values = drift_values(bench, list(cycles.values()))
    first = values["runs"][0]
    assert [first["law"], first["motion"]] == ["plain", FAST]
    assert len(first["minutes"]["rms"]) == 6 - (0 if first["lost"] is None else 1)
    assert values["runs"][-1]["safeguards"][0] == {"kind": "leakage", "rate": 1.0}


def test_pictures_show_every_law_and_a_lost_loop_ends(bench, cycles):
    runs = [replace(cycles["plain"], lost=6), *(cycles[law.name] for law in GUARDED)]
    axes = drift_figure(bench, runs).axes
    assert [len(ax.get_lines()) for ax in axes] == [7, 8, 7, 7]  # a cross, and the border at 1
    assert axes[-1].get_xlabel() == "time (min)"
    rest = path_figure(bench, [bench.run(resting(), 1)])
    assert len(rest.axes[0].get_lines()) == 5


def test_a_continuous_scenario_is_refused_before_anything_is_written(tmp_path):
    app = typer.Typer()
    app.command()(drift)
    failed = CliRunner().invoke(app, ["-s", "nominal", "--out", str(tmp_path / "x")])
    assert isinstance(failed.exception, ParameterError)
    assert not (tmp_path / "x").exists()


def test_minutes_of_work_come_last_in_a_cycle():
    assert [REST_AND_WORK.works(k) for k in range(6)] == [False] * 4 + [True, False]
    assert REST_AND_WORK.reference(0)([30.0])[0, 0] == 0.0
    assert set(REST_AND_WORK.reference(4)([1.0, 4.0])[0]) == {1.0, 2.0}


def test_misuse_is_refused(bench):
    with pytest.raises(ParameterError, match="sampled"):
        DriftBench(scenario=load_scenario("nominal"))
    with pytest.raises(ParameterError, match="work"):
        replace(REST_AND_WORK, work=6)
    with pytest.raises(ParameterError, match="minutes"):
        drift_runs(bench, [resting()], 0)
