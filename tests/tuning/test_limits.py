from __future__ import annotations

from dataclasses import replace

import pytest

from mrac_design.robot import build_dynamics, load_robot
from mrac_design.simulation.scenario import load_scenario
from mrac_design.study import scenario_design
from mrac_design.tuning.bench import prepare_case
from mrac_design.tuning.limits import answer_strengths, loop_limits, true_delay_margin
from mrac_design.tuning.variables import placed, read_variables
from tests.oracles.adaptive_delay_margin import adaptive_delay_margin
from tests.tuning.conftest import small


@pytest.mark.parametrize("strength", [1.0, 1.25])
@pytest.mark.parametrize("stiffness", [800.0, 1200.0])
@pytest.mark.parametrize(("k2", "ao", "speed"), [(0, 2000, 0.0), (50, 500, 494.0), (20, 300, 9e3)])
def test_margin_is_that_of_the_closed_forms(k2, ao, speed, stiffness, strength):
    scenario = placed(load_scenario("nominal"), read_variables("k2,ao"), (k2, ao))
    found = true_delay_margin(
        scenario_design(scenario), speed=speed, stiffness=stiffness, strength=strength
    )
    expected = adaptive_delay_margin(
        k2=k2, omega=500.0, xi=1.0, ao=ao, b0=800.0, speed=speed,
        stiffness=stiffness, strength=strength,
    )  # fmt: skip
    # The oracle's gains are floats, its crossing is good to 1e-9 rad/s.
    assert found == pytest.approx(expected, rel=1e-9)


def test_model_error_is_felt_axis_by_axis():
    scenario = load_scenario("parameters")
    dynamics = build_dynamics(load_robot(scenario.robot))
    # Every body of the model is 5 % too heavy, drives included; the first joint alone moves the tip
    # along Z and its row is 25 % off.
    assert answer_strengths(scenario, dynamics) == (1.05, 1.25)
    assert answer_strengths(load_scenario("nominal"), dynamics) == (1.0,)


def test_worst_level_and_tissue_count():
    scenario = small()
    alone = loop_limits(scenario, (1.0,))
    steps = replace(
        scenario.contact, stiffness_factor=replace(
            scenario.contact.stiffness_factor, times=(0.0, 0.1), levels=(0.5, 1.0)
        )
    )  # fmt: skip
    # Softer tissue has more margin, so that with steps in it the stiff one still decides.
    assert loop_limits(replace(scenario, contact=steps), (1.0,)) == alone
    assert loop_limits(replace(scenario, stiffness=600.0), (1.0,)).delay_margin > alone.delay_margin
    assert loop_limits(scenario, (1.0, 1.3)).delay_margin < alone.delay_margin


def test_speed_is_measured_against_the_integration():
    scenario = small()
    limits = loop_limits(scenario, (1.0,))
    # λ = γ̂ ω |φ̂|²/(α + |φ̂|²) with |φ̂|² = 2 · 1.5² N² at ao = ω; RK4 damps λΔt < 2.785.
    speed = 500.0 * 4.5 / 4.6
    assert limits.speed_share == pytest.approx(speed * scenario.simulation.step / 2.785, rel=1e-12)
    finer = replace(scenario, simulation=replace(scenario.simulation, step=1e-5))
    assert loop_limits(finer, (1.0,)).speed_share == pytest.approx(
        limits.speed_share * 1e-5 / scenario.simulation.step, rel=1e-12
    )


def test_simulated_dead_time_breaks_the_loop_at_the_margin():
    """The whole robot sampled at 10 kHz, dead time 0.1 ms either side of the margin."""
    exact = load_scenario("reality").sampling
    scenario = replace(
        small(),
        design=replace(small().design, velocity_gain=0.0),
        reference=replace(
            small().reference, steps=tuple(
                replace(s, times=(0.0,), levels=(1.5,)) for s in small().reference.steps
            )
        ),
        simulation=replace(small().simulation, duration=0.6, settling=0.3, step=1e-4),
    )  # fmt: skip
    margin = prepare_case(scenario).limits((), ()).delay_margin
    worst = {}
    for samples in (8, 10):
        sampling = replace(
            exact,
            rate=10_000.0,
            delay=samples,
            force_sensor=replace(exact.force_sensor, noise=0.0, resolution=0.0),
            encoder=replace(exact.encoder, counts_per_turn=0.0),
        )
        case = prepare_case(replace(scenario, sampling=sampling))
        result = case.result((), ())
        # Delay and half a period of hold are taken off what the continuous loop has.
        dead = (samples + 0.5) * 1e-4
        assert result.limits.delay_margin == pytest.approx(max(0.0, margin - dead), abs=1e-12)
        worst[dead] = result.worst
    before, beyond = worst.values()
    assert 0.85e-3 < margin < 1.05e-3
    assert before < 2.0
    assert beyond > 10 * before
