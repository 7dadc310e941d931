"""The engines against SciPy, against their own order, and against one another."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.compilation import find_compiler
from mrac_design.simulation.dormand_prince_8 import DORMAND_PRINCE_8
from mrac_design.simulation.engine import CompiledEngine, InterpretedEngine, LlvmEngine
from mrac_design.simulation.run import Recording, RunSettings, run
from mrac_design.simulation.tableau import DORMAND_PRINCE_5, RK4
from mrac_design.simulation.verner_7 import VERNER_7
from tests.simulation.small_systems import INITIAL_STATE, PARAMETER_VALUES, pendulum, pushes

METHODS = (
    RK4,
    DORMAND_PRINCE_5,
    DORMAND_PRINCE_8,
    VERNER_7,
)

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler here")


def compiled(system, method, inputs):
    return CompiledEngine(system, method, input_powers=inputs.degree + 1, compiler=find_compiler())


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
    for index, (start, end) in enumerate(pairwise(borders)):
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
@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_three_machines_agree(method, sampling_period):
    pytest.importorskip("llvmlite")
    system, inputs = pendulum(sampling_period=sampling_period), pushes()
    engines = (
        compiled(system, method, inputs),
        LlvmEngine(system, method, input_powers=3),
        InterpretedEngine(system, method, input_powers=3),
    )
    c, llvm, casadi = (recording_of(engine, system, inputs, step=0.01) for engine in engines)
    assert np.array_equal(c.outputs, llvm.outputs)
    assert np.array_equal(c.final_state, llvm.final_state)
    # CasADi rounds a product before its sum, the others do not.
    np.testing.assert_allclose(casadi.outputs, c.outputs, rtol=1e-12, atol=1e-13)


@needs_compiler
def test_denormal_numbers_are_zero_inside_a_run_and_live_outside():
    """A number below 2e-308 counts as 0 and does not slow anything down."""
    system, inputs = pendulum(), pushes(jump=0.0)
    still = PiecewisePolynomial(breakpoints=[0.0, 2.0], coefficients=np.zeros((2, 1, 3)))
    tiny = np.array([0.0, 0.0, 3e-310])
    engine = compiled(system, RK4, inputs)
    settings = RunSettings(duration=1.0, step=1e-3, record_period=0.1)
    final = run(
        engine, system, inputs=still, parameters=PARAMETER_VALUES, initial_state=tiny,
        settings=settings,
    ).final_state  # fmt: skip
    assert final[2] == 0.0
    assert np.float64(1e-300) * np.float64(1e-10) > 0


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


@needs_compiler
def test_steps_longer_than_a_record_are_interpolated():
    """The same records as with a step for each, to the order of the interpolation (7)."""
    system, inputs = pendulum(), pushes()
    engine = compiled(system, DORMAND_PRINCE_8, inputs)
    exact = recording_of(engine, system, inputs, step=0.01, record_period=0.01).outputs
    errors = [
        np.abs(recording_of(engine, system, inputs, step=step).outputs - exact).max()
        for step in (0.32, 0.16)
    ]
    assert errors[0] > 1e-9
    assert np.log2(errors[0] / errors[1]) > 6
    coarse = recording_of(engine, system, inputs, step=0.08).outputs
    assert np.abs(coarse - exact).max() < 1e-9


@needs_compiler
def test_long_steps_do_not_cross_updates():
    system, inputs = pendulum(sampling_period=0.02), pushes()
    engine = compiled(system, DORMAND_PRINCE_8, inputs)
    fine = recording_of(engine, system, inputs, step=0.001, record_period=0.005)
    long = recording_of(engine, system, inputs, step=1.0, record_period=0.005)
    # The memory is the same at every record and the angle agrees to the error of 20 ms steps.
    assert np.array_equal(fine.outputs[:, 4], long.outputs[:, 4])
    assert np.abs(fine.outputs - long.outputs).max() < 1e-9
