from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrac_design.comparison.bench import (
    FINE,
    Bench,
    Sensing,
    root_mean_square,
    with_quantised_force,
)
from mrac_design.comparison.comparison import contestants
from mrac_design.comparison.contestant import TuningParameter
from mrac_design.comparison.setting import Periods
from mrac_design.errors import ParameterError

ALL = {contestant.name: contestant for contestant in contestants()}
PERIODS = Periods(beat=0.5, breath=4.0)
QUICK = [name for name in ALL if name not in ("learning", "gpc", "preview", "integral")]


@pytest.mark.parametrize("name", ALL)
def test_every_tuning_vector_is_a_controller(name, setting):
    contestant = ALL[name]
    random = np.random.default_rng(0)
    for position in (contestant.position(contestant.start), random.random(contestant.start.size)):
        axis = contestant.build(setting, PERIODS, contestant.values(position))
        assert np.isfinite(
            axis.step.parameter_values[np.isfinite(axis.step.parameter_values)]
        ).all()
        assert axis.step.signals.slices["desired_force"]


@pytest.mark.parametrize("name", ALL)
def test_positions_and_values_are_inverse(name):
    contestant = ALL[name]
    values = contestant.values(np.linspace(0.1, 0.9, contestant.start.size))
    assert np.allclose(contestant.values(contestant.position(values)), values, rtol=1e-12)
    assert np.allclose(
        contestant.values(np.ones(values.size)), [p.high for p in contestant.parameters]
    )


@pytest.mark.parametrize("name", QUICK)
def test_equations_do_not_depend_on_the_tuning(name, setting):
    """One compiled loop serves all tunings, or tuning would compile for hours."""
    contestant = ALL[name]
    texts = set()
    for share in (0.4, 0.6):
        values = contestant.values(np.full(contestant.start.size, share))
        step = contestant.build(setting, PERIODS, values).step
        texts.add(step.command.serialize() + step.advance.serialize())
    assert len(texts) == 1


def test_the_motion_predictor_uses_the_breath_it_is_told(specification, conditions):
    """With a slow disturbance too stiff to carry the breathing, its rhythm has to."""
    contestant, condition = ALL["gpc"], conditions.training
    values = np.array(contestant.start)
    values[6], values[7] = 1e-3, 1e-3  # slow drive (m/s²), breath drive (N)
    setting, true = specification.setting, condition.periods
    bench = Bench(setting)
    told, misled = (
        root_mean_square(
            bench.force_error(
                contestant.build(setting, replace(true, breath=breath), values),
                condition,
                Sensing.perfect(),
            )
        )
        for breath in (true.breath, 0.61 * true.breath)
    )
    assert told < 0.9 * misled


def test_names_are_unique_and_the_frozen_one_leads():
    assert len(ALL) == len(contestants()) == 18
    assert next(iter(ALL)) == "frozen"


def test_readings_are_multiples_of_the_resolution(setting):
    axis = ALL["frozen"].build(setting, PERIODS, ALL["frozen"].start)
    coarse = with_quantised_force(axis.step, 0.005)
    state = axis.step.equilibrium(1.0, axis.step.parameter_values)
    for force, reading in ((1.0024, 1.0), (1.0026, 1.005), (-0.0126, -0.015)):
        expected = axis.step.command(state, reading, 1.0, axis.step.parameter_values)
        found = coarse.command(state, force, 1.0, coarse.parameter_values)
        assert float(found) == pytest.approx(float(expected), rel=1e-9)


def test_a_fine_resolution_is_none(setting):
    axis = ALL["mrac_bias"].build(setting, PERIODS, ALL["mrac_bias"].start)
    fine = with_quantised_force(axis.step, FINE)
    state = axis.step.equilibrium(1.0, axis.step.parameter_values)
    found = fine.advance(state, 1.234, 1.0, 0.1, fine.parameter_values)[0]
    expected = axis.step.advance(state, 1.234, 1.0, 0.1, axis.step.parameter_values)[0]
    assert np.allclose(found.full(), expected.full(), atol=1e-6)


def test_the_bench_tells_tunings_apart_without_compiling_again(setting, short):
    bench = Bench(setting=setting)
    contestant = ALL["frozen_inverse"]
    errors = [
        root_mean_square(
            bench.force_error(
                contestant.build(setting, PERIODS, contestant.values(np.array(position))),
                short,
                Sensing.of(setting, 0),
            )
        )
        for position in ((0.3, 0.5, 0.5), (0.5, 0.5, 0.5))
    ]
    assert errors[0] > 1.2 * errors[1]  # a slower loop leaves more of the motion
    assert len(bench._compiled) == 1


def test_velocity_gain_and_stiffness_reach_the_plant(setting, short):
    """With noise and motion as they are, a stiffer tissue and another K2 change the force."""
    bench, contestant = Bench(setting=setting), ALL["frozen_inverse"]
    axis = contestant.build(setting, PERIODS, contestant.start)
    sensing = Sensing.of(setting, 0)
    base = bench.force_error(axis, short, sensing)
    stiffer = replace(short, stiffness_factor=1.5)
    assert root_mean_square(bench.force_error(axis, stiffer, sensing) - base) > 1e-3
    braked = replace(axis, velocity_gain=100.0)
    assert root_mean_square(bench.force_error(braked, short, sensing) - base) > 1e-3


def test_bounds_must_be_in_order():
    with pytest.raises(ParameterError, match="low <= start"):
        TuningParameter(name="x", unit="", low=1.0, high=2.0, start=3.0)
