"""A tuned controller among python-control's objects, and back."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from mrac_design.controller.adaptive import build_step
from mrac_design.errors import MracDesignError, ParameterError
from mrac_design.export.control_objects import (
    adaptive_system,
    frozen_state_space,
    loop_pieces,
    redesigned,
)
from mrac_design.export.gains import controller_of
from mrac_design.time_domain import Continuous, Discrete
from tests.export.gain_sets import gain_sets, internal_model_gain_set, nominal_gain_set


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(gains=gain_sets(digits=15))
def test_transfer_functions_give_the_same_gains_back(gains):
    back = redesigned(gains, loop_pieces(gains))
    assert back == gains
    own = build_step(controller_of(gains, Continuous())).parameter_values
    assert build_step(controller_of(back, Continuous())).parameter_values.tobytes() == own.tobytes()


def test_a_design_changed_in_python_control_becomes_gains():
    gains, pieces = nominal_gain_set(), loop_pieces(nominal_gain_set())
    other = replace(
        gains,
        specification=replace(gains.specification, observer=(1.0, 400.0)),
        coefficients=(1350.0, 728.125, 125000.0, 312.5, 125000.0),
    )
    changed = redesigned(gains, loop_pieces(other))
    assert changed.coefficients == other.coefficients
    assert changed.specification == other.specification
    # They started from the design's own gains and go on doing so.
    assert changed.initial_gains == tuple(other.design.scaled_parameters.tolist())
    with pytest.raises(MracDesignError, match="residual"):
        redesigned(gains, replace(pieces, plant=control.tf([900.0], [1.0, 50.0, 0.0])))


def test_an_internal_model_moves_in_and_out_through_python_control():
    """R holds D as a factor; gains that started from the design's own follow its count."""
    plain, resonant = nominal_gain_set(), internal_model_gain_set()
    there = redesigned(plain, loop_pieces(resonant))
    assert there.specification == resonant.specification
    assert there.initial_gains == resonant.initial_gains
    assert redesigned(there, loop_pieces(plain)) == plain
    detuned = replace(loop_pieces(resonant), internal_model=control.tf([1.0], [1.0, 10.0, 1500.0]))
    with pytest.raises(ParameterError, match="must have the internal model"):
        redesigned(resonant, detuned)
    own = replace(plain, initial_gains=(0.5,) * 5)
    with pytest.raises(ParameterError, match="initial gains"):
        redesigned(own, loop_pieces(resonant))


@pytest.mark.parametrize(
    ("name", "system"),
    [
        ("feedback", control.tf([1.0], [1.0, 2.0])),
        ("feedback", control.tf([1.0, 1.0], [1.0, 2.0], dt=1e-3)),
        ("feedforward", control.tf([1.0, 1.0], [1.0, 2.0, 3.0])),
        ("feedforward", control.tf([312.5, 156250.0], [1.0, 1451.0])),
        ("observer", control.tf([1.0, 1.0], [1.0, 500.0])),
        ("observer", control.tf([1.0], [1.0, 500.0], dt=1e-3)),
        ("observer", control.tf([1.0], [1.0, 20.0, 100.0])),
        ("internal_model", control.tf([1.0], [1.0, 0.0])),
        ("internal_model", control.tf([2.0], [1.0])),
        ("reference_model", control.tf([1.0], [1.0, 500.0])),
        ("plant", control.tf([800.0], [1.0, 50.0, 1.0])),
    ],
)
def test_pieces_of_another_shape_are_refused(name, system):
    pieces = replace(loop_pieces(nominal_gain_set()), **{name: system})
    with pytest.raises(ParameterError):
        redesigned(nominal_gain_set(), pieces)


@pytest.mark.parametrize("made", [nominal_gain_set, internal_model_gain_set])
def test_pieces_close_to_the_reference_model(made):
    """Closing the pieces as the block diagram says gives ω²/Am from u_c to y."""
    pieces = loop_pieces(made())
    closed = pieces.feedforward * control.feedback(pieces.plant, pieces.feedback)
    for omega in (1.0, 50.0, 500.0, 5000.0):
        # Products of polynomials spread over 16 decades.
        assert closed(1j * omega) == pytest.approx(pieces.reference_model(1j * omega), rel=1e-9)


@pytest.mark.parametrize("made", [nominal_gain_set, internal_model_gain_set])
def test_state_space_is_the_two_transfer_functions(made):
    gains, pieces = made(), loop_pieces(made())
    system = frozen_state_space(gains)
    assert system.nstates == gains.specification.degree
    for s in (0.0, 3j, 700j, 1e4j):
        response = system(s)
        np.testing.assert_allclose(response[0, 0], pieces.feedforward(s), rtol=1e-12)
        np.testing.assert_allclose(response[0, 1], -pieces.feedback(s), rtol=1e-12)


def test_adaptive_system_simulated_by_python_control_is_the_step():
    gains, period, count = nominal_gain_set(), 1e-3, 60
    step = build_step(controller_of(gains, Discrete(period)))
    time = period * np.arange(count)
    force, reference = 1 + 0.1 * np.sin(60 * time), np.where(time < 0.02, 1.0, 1.5)
    start = step.equilibrium(1.0, step.parameter_values).full().ravel()
    system = adaptive_system(gains, Discrete(period))
    assert system.dt == period
    response = control.input_output_response(system, time, np.vstack([force, reference]), start)
    commands, state = np.ravel(response.outputs), start
    for k in range(count):
        command = step.command(state, force[k], reference[k], step.parameter_values)
        assert commands[k] == float(command)
        state = step.advance(state, force[k], reference[k], command, step.parameter_values)[0]
    assert np.abs(commands).max() > 1.0


def test_adaptive_system_takes_other_parameters():
    system = adaptive_system(nominal_gain_set(), Continuous())
    frozen = {name: 0.0 for name in system.params if name.startswith("adaptation_gain")}
    assert len(frozen) == 6
    x = np.full(system.nstates, 0.3)
    gains = [i for i, name in enumerate(system.state_labels) if name.startswith("gains")]
    moving = system.dynamics(0.0, x, [1.0, 1.5])[gains]
    still = system.dynamics(0.0, x, [1.0, 1.5], params=frozen)[gains]
    assert np.abs(moving).max() > 0
    assert not still.any()


def test_adaptive_system_carries_the_steps_parameters():
    step = build_step(controller_of(nominal_gain_set(), Discrete(5e-4)))
    system = adaptive_system(nominal_gain_set(), Discrete(5e-4))
    values = np.array([system.params[name] for name in step.parameters.entry_names])
    assert values.tobytes() == step.parameter_values.tobytes()
