"""The engines against SciPy, against their own order, and against one another."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mrac_design.simulation.compilation import find_compiler
from mrac_design.simulation.engine import CompiledEngine, InterpretedEngine
from mrac_design.simulation.run import Recording, RunSettings, run
from mrac_design.simulation.tableau import DORMAND_PRINCE_5, RK4
from tests.simulation.small_systems import INITIAL_STATE, PARAMETER_VALUES, pendulum, pushes

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler here")


def compiled(system, method, inputs):
    return CompiledEngine(
        system, method, input_powers=inputs.degree + 1, compiler=find_compiler()
    )


def recording_of(engine, system, inputs, *, step=1e-3, duration=2.0, record_period=0.01):
    return run(
        engine,
        system,
        inputs=inputs,
        parameters=PARAMETER_VALUES,
        initial_state=INITIAL_STATE,
        settings=RunSettings(duration=duration, step=step, record_period=record_period),
    )


def dop853(system, inputs, *, duration=2.0):
    """Final state by SciPy, restarted where the inputs jump; no memory."""
    state, borders = INITIAL_STATE, inputs.breakpoints
    for index, (start, end) in enumerate(zip(borders[:-1], borders[1:], strict=True)):
        piece = inputs.coefficients[:, index, ::-1]

        def slopes(t, x, piece=piece, start=start):
            v = np.array([np.polyval(channel, t - start) for channel in piece])
            return system.rate(x, np.zeros(0), v, PARAMETER_VALUES).full().ravel()

        end = min(end, duration)
        state = solve_ivp(slopes, (start, end), state, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return state


def final_error(method, step, exact, system, inputs):
    engine = compiled(system, method, inputs)
    recording = recording_of(engine, system, inputs, step=step, record_period=1.0)
    return np.abs(recording.final_state - exact).max()


@needs_compiler
@pytest.mark.parametrize("method", [RK4, DORMAND_PRINCE_5], ids=lambda method: method.name)
def test_error_falls_with_the_methods_order_though_inputs_jump(method):
    system, inputs = pendulum(), pushes()
    exact = dop853(system, inputs)
    errors = [final_error(method, step, exact, system, inputs) for step in (0.04, 0.02)]
    # 2^order, within what the next term of the error adds at these steps.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(method.order, abs=0.5)
    # A tenth of the step lowers it to the oracle's own tolerance.
    assert final_error(method, 0.001, exact, system, inputs) < 1e-11


@needs_compiler
@pytest.mark.parametrize("sampling_period", [None, 0.005])
@pytest.mark.parametrize("method", [RK4, DORMAND_PRINCE_5], ids=lambda method: method.name)
def test_compiled_and_interpreted_runs_have_the_same_bits(method, sampling_period):
    system, inputs = pendulum(sampling_period=sampling_period), pushes()
    fast = compiled(system, method, inputs)
    slow = InterpretedEngine(system, method, input_powers=inputs.degree + 1)
    one, other = (recording_of(engine, system, inputs, step=0.002) for engine in (fast, slow))
    assert np.array_equal(one.outputs, other.outputs)
    assert np.array_equal(one.final_state, other.final_state)


@needs_compiler
def test_memory_is_updated_at_every_sampling_instant_and_held_between():
    system, inputs = pendulum(sampling_period=0.005), pushes()
    recording: Recording = recording_of(compiled(system, RK4, inputs), system, inputs)
    torque, count = recording.outputs[:, 3], recording.outputs[:, 4]
    # Records every second update, updates first: 1, 3, 5, ...
    assert np.array_equal(count, 1 + 2 * np.arange(count.size))
    assert np.ptp(torque) > 0.1


@needs_compiler
def test_inputs_are_recorded_right_continuous():
    system, inputs = pendulum(), pushes(jump=0.5)
    recording = recording_of(
        compiled(system, RK4, inputs), system, inputs, record_period=0.3137, duration=1.0
    )
    assert recording.outputs[1, 2] == pytest.approx(0.7, abs=1e-15)
