from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrac_design.comparison.bench import Bench, Sensing, root_mean_square
from mrac_design.comparison.comparison import contestants
from mrac_design.comparison.judging import LOST, Measured, judge
from mrac_design.comparison.rst_contestants import box_is_certified, rst_design
from mrac_design.comparison.setting import Periods
from mrac_design.comparison.tuning import BASE_SHARE, tune
from mrac_design.errors import ParameterError

ALL = {contestant.name: contestant for contestant in contestants()}
PERIODS = Periods(beat=1.0, breath=5.0)


@pytest.fixture(scope="module")
def bench(setting):
    return Bench(setting=setting)


def test_the_budget_is_spent_and_no_more(bench, short):
    shares = []
    tuning = tune(ALL["observer"], bench, short, budget=20, seed=0, progress=shares.append)
    assert tuning.evaluations == len(shares) == 20
    assert shares[-1] == 1.0
    start = ALL["observer"].build(bench.setting, PERIODS, ALL["observer"].start)
    sensing = Sensing.of(bench.setting, 0)
    first = root_mean_square(bench.force_error(start, short, sensing))
    assert tuning.admissible
    assert tuning.error < first  # the start is one of those tried


def test_the_same_seed_finds_the_same(bench, short):
    one, other = (tune(ALL["frozen_inverse"], bench, short, budget=12, seed=5) for _ in range(2))
    assert np.array_equal(one.values, other.values)


def test_the_rule_on_dead_time_is_kept(bench, short, setting):
    """With a rule hard to keep, the tuner gives up error for it."""
    strict = Bench(setting=replace(setting, allowed_growth=1.3))
    free = tune(ALL["frozen_inverse"], bench, short, budget=20, seed=0)
    held = tune(ALL["frozen_inverse"], strict, short, budget=20, seed=0)
    assert free.delayed_error <= 2.0 * free.error
    assert held.delayed_error <= 1.31 * held.error
    assert held.error > free.error


def test_without_its_proof_a_tuning_is_not_admissible(bench, short):
    unproved = replace(ALL["mrac_certified"], proof=lambda setting, values: False)
    tuning = tune(unproved, bench, short, budget=5, seed=0)
    assert not tuning.admissible
    assert not tuning.proved


def test_a_small_box_is_certified_and_a_large_one_is_not(setting):
    pytest.importorskip("cvxpy")
    design = rst_design(setting, np.array([250.0, 1.0]))
    assert box_is_certified(setting, design, 0.1)
    assert not box_is_certified(setting, design, 0.5)


def test_a_law_that_adapts_is_tuned_after_the_controller_it_adapts(bench, short):
    """The first stage leaves the adaptation where it starts; only the last may move it."""
    contestant = ALL["mrac_resonant"]
    tried = []

    def recorded(setting, periods, values):
        tried.append(values)
        return contestant.build(setting, periods, values)

    budget = 48
    tune(replace(contestant, build=recorded, proof=None), bench, short, budget=budget, seed=0)
    moved = [
        not np.allclose(values[contestant.base :], contestant.start[contestant.base :])
        for values in tried
    ]
    assert not any(moved[: round(BASE_SHARE * budget)])
    assert any(moved)


def test_a_budget_of_nothing_is_refused(bench, short):
    with pytest.raises(ParameterError, match="budget"):
        tune(ALL["frozen"], bench, short, budget=1, seed=0)


def test_an_unstable_loop_is_lost_not_an_error(bench, conditions):
    contestant = ALL["frozen_inverse"]
    judgement = judge(
        contestant, np.array([1500.0, 5.0, 1e-3]), bench, conditions.judged[:1], seeds=2
    )
    measured = judgement.conditions["held_back"]
    assert measured.lost
    assert measured.worst > LOST
    assert measured.half_width == np.inf or np.isfinite(measured.rms).all()


def test_linear_parts_add_up(bench, conditions):
    """What motion and noise cause apart is, for a linear law, what they cause together."""
    contestant = ALL["frozen_inverse"]
    judgement = judge(contestant, contestant.start, bench, conditions.judged[:1], seeds=4)
    together = np.hypot(
        judgement.motion_error, judgement.amplification * bench.setting.sensor_noise
    )
    measured = judgement.conditions["held_back"]
    # Noise and motion are uncorrelated only on average over 6 s.
    assert measured.mean == pytest.approx(together, rel=0.1)


def test_the_interval_is_student_s():
    """Five numbers whose interval is in every table: t(0.975, 4) = 2.776."""
    rms = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    measured = Measured(rms=rms, largest=np.full(5, 0.1))
    assert measured.half_width == pytest.approx(2.7764 * np.sqrt(2.5) / np.sqrt(5), rel=1e-4)
    assert measured.mean == 3.0
    assert not measured.lost
