"""What holds for every rival: rest, the step against its table, the loop it closes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrac_design.controller.rivals.active_observer import active_observer
from mrac_design.controller.rivals.linear import build_linear_step
from mrac_design.time_domain import Discrete
from tests.controller.rivals.cases import (
    DELAY,
    FORCE_LOOP,
    OBSERVER,
    PERIOD,
    PREVIEW,
    STIFFNESS,
    VELOCITY_GAIN,
    linear_rivals,
    rival_steps,
)
from tests.oracles import sampled_force_loop as loop

LINEAR, STEPS = linear_rivals(), rival_steps()


@pytest.mark.parametrize("name", STEPS)
def test_rests_under_a_constant_force_with_command_zero(name):
    step, force = STEPS[name], 1.7
    p = step.parameter_values
    x = step.equilibrium(force, p)
    events = [0.3] if step.events.size else []
    following, signals = step.advance(x, force, force, 0.0, p, *events)
    resting = np.zeros(x.numel()) if name == "integral RST" else x.full().ravel()
    result = following.full().ravel()
    if name == "beat preview":  # the clock goes on, nothing else
        age = step.state.slices["age"]
        assert result[age] == pytest.approx(0.3 + PREVIEW.time_domain.period)
        result[age] = resting[age]
    # Entries reach 1e5 (the observer of the RST), rounding scales with them.
    scale = np.abs(x.full()).max() * (1e3 if name == "integral RST" else 1.0)
    np.testing.assert_allclose(result, resting, atol=1e-9 * max(scale, 1.0))
    # A command is the difference of terms of up to about 1e3 m/s² for a newton.
    assert abs(float(step.command(x, force, force, p))) < 1e-8
    desired = step.signals.split(signals.full().ravel())["desired_force"]
    assert desired == pytest.approx(force)


@pytest.mark.parametrize("name", LINEAR)
def test_the_step_computes_its_table(name):
    controller, step = LINEAR[name], STEPS[name]
    rows, command = controller.matrices()
    random = np.random.default_rng(3)
    x = random.standard_normal(rows.shape[0])
    y, r, u = random.standard_normal(3)
    columns = np.concatenate([x, [y, r, u]])
    following, _ = step.advance(x, y, r, u, step.parameter_values)
    size = np.abs(rows) @ np.abs(columns) + 1.0
    assert (np.abs(following.full().ravel() - rows @ columns) / size).max() < 1e-13
    given = float(step.command(x, y, r, step.parameter_values))
    assert given == pytest.approx(command @ columns, abs=1e-12 * (np.abs(command) @ abs(columns)))


@pytest.mark.parametrize("name", LINEAR)
def test_the_loop_is_stable_with_margin_to_a_stiffer_heart(name):
    controller = LINEAR[name]
    if not isinstance(controller.time_domain, Discrete):
        pytest.skip("continuous: its poles are tested with its design")
    delay = 0 if "without dead time" in name else DELAY
    rows, command = controller.matrices()
    # What repeats every period at high frequency is learned through a plant gain of 1e-4 and less,
    # so those poles reach the unit circle; the memory's mean repeats what the integrator does.
    repetitive = name in ("predictive with breath", "learning")
    for stiffness in (STIFFNESS,) if repetitive else (STIFFNESS, 1.2 * STIFFNESS):
        phi, gamma = loop.plant(stiffness, VELOCITY_GAIN, PERIOD)
        poles = np.linalg.eigvals(loop.closed_matrix(rows, command, phi, gamma, delay))
        assert np.abs(poles).max() < (1.0 + 1e-6 if repetitive else 1.0)


@pytest.mark.parametrize("name", LINEAR)
def test_feedback_is_the_same_loop(name):
    controller = LINEAR[name]
    if not isinstance(controller.time_domain, Discrete):
        pytest.skip("the oracle is sampled")
    rows, command = controller.matrices()
    phi, gamma = loop.plant(STIFFNESS, VELOCITY_GAIN, PERIOD)
    M = loop.closed_matrix(rows, command, phi, gamma, 0)
    system = controller.feedback()
    z = 1.3 * np.exp(0.7j)
    G = np.array([1.0, 0.0]) @ np.linalg.solve(z * np.eye(2) - phi, gamma)
    # det(zI − M) = det(zI − A_controller) det(zI − Φ) (1 − G K)
    parts = np.linalg.det(z * np.eye(system.nstates) - system.A) * np.linalg.det(
        z * np.eye(2) - phi
    )
    whole = np.linalg.det(z * np.eye(M.shape[0]) - M)
    assert whole == pytest.approx(parts * (1.0 - G * system(z)), rel=1e-6)


def test_coefficients_are_parameters_so_retuning_keeps_the_code():
    retuned = build_linear_step(
        active_observer(replace(OBSERVER, force_loop=replace(FORCE_LOOP, time_constant=0.006)))
    )
    first = STEPS["active observer"]
    assert retuned.parameters == first.parameters
    assert not np.allclose(retuned.parameter_values, first.parameter_values)
