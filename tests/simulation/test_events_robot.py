"""Contact lost and found by the robot under a continuous controller, against SciPy's DOP853."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mrac_design.motion import StepSequence
from mrac_design.motion.signal import PiecewisePolynomial, stack
from mrac_design.simulation.closed_loop import ForceLoop, build_force_loop, resting_state
from mrac_design.simulation.compilation import find_compiler
from mrac_design.simulation.contact import LinearSpring, OneSided, retreating
from mrac_design.simulation.dormand_prince_8 import DORMAND_PRINCE_8
from mrac_design.simulation.engine import CompiledEngine
from mrac_design.simulation.friction import Frictionless
from mrac_design.simulation.run import RunSettings, run
from mrac_design.simulation.system import Kinks
from mrac_design.time_domain import Continuous
from tests.robot_steps import STIFFNESS, controller_of, dynamics_of, linearisation_of

ROBOT, END = "planar_2r", 0.35
RETREAT = StepSequence(times=(0.0, 0.05, 0.2), levels=(0.0, 1.8e-3, 0.0))

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler here")


def loop_with(kinks: Kinks) -> ForceLoop:
    return build_force_loop(
        dynamics_of(ROBOT),
        linearisation_of(ROBOT),
        [controller_of(Continuous())] * 2,
        contact=OneSided(tissue=LinearSpring(STIFFNESS)),
        friction=Frictionless(),
        kinks=kinks,
    )


def heart_and_reference() -> PiecewisePolynomial:
    tip = dynamics_of(ROBOT).task_position(dynamics_of(ROBOT).description.home).full().ravel()[:2]
    whole = np.array([0.0, END])
    heart = PiecewisePolynomial(
        breakpoints=whole, coefficients=np.array([[[0.0, 2e-3]], [[0.0, -1e-3]]])
    ).shifted(tip - 1.0 / STIFFNESS)
    reference = PiecewisePolynomial(breakpoints=whole, coefficients=np.ones((2, 1, 1)))
    return stack(retreating(heart, RETREAT), reference)


def start_of(loop: ForceLoop) -> np.ndarray:
    home = loop.dynamics.description.home
    return resting_state(loop, posture=home, force=[1.0, 1.0], condition_limit=100.0)


def by_scipy(inputs: PiecewisePolynomial) -> tuple[np.ndarray, list[float]]:
    """Final state and instants of contact: true law, restarted wherever it has a kink or a jump."""
    loop = loop_with(Kinks.CROSSED)
    task = loop.dynamics.task_position

    def depth(axis: int, t: float, x: np.ndarray) -> float:
        return float(task(x[:2])[axis]) - float(inputs(t)[axis, 0])

    def crossing(axis: int, side: tuple[float, float]) -> Callable[..., float]:
        def function(t: float, x: np.ndarray) -> float:
            return depth(axis, float(np.clip(t, *side)), x)

        function.terminal = True
        return function

    state, instants = start_of(loop), []
    for left, right in zip((0.0, 0.05, 0.2), (0.05, 0.2, END), strict=True):
        side = (left, np.nextafter(right, left))  # the input of this side of a jump

        def rate(t: float, x: np.ndarray, side: tuple[float, float] = side) -> np.ndarray:
            v = inputs(float(np.clip(t, *side)))[:, 0]
            return loop.system.rate(x, [], v, loop.parameter_values).full().ravel()

        now = left
        while now < right:
            piece = solve_ivp(
                rate, (now, right), state, method="DOP853", rtol=1e-12, atol=1e-13,
                events=[crossing(axis, side) for axis in range(2)],
            )  # fmt: skip
            now, state = piece.t[-1], piece.y[:, -1]
            if piece.status == 1:
                instants.append(now)
                # Past the root, or the next piece would end where it begins.
                now += 1e-9
                state = state + 1e-9 * rate(now, state)
    return state, instants


def test_instants_and_state_agree_with_dop853():
    inputs, loop = heart_and_reference(), loop_with(Kinks.LOCATED)
    engine = CompiledEngine(
        loop.system, DORMAND_PRINCE_8, input_powers=inputs.degree + 1, compiler=find_compiler()
    )
    recording = run(
        engine,
        loop.system,
        inputs=inputs,
        parameters=loop.parameter_values,
        initial_state=start_of(loop),
        settings=RunSettings(duration=END, step=2e-4, record_period=1e-3),
    )
    state, instants = by_scipy(inputs)
    # What jumps with the surface is an event at that very instant and no root for SciPy, which
    # passes the limits of the efforts by its error control.
    located = [
        event.time
        for event in recording.events
        if event.event.name.startswith("contact") and event.time not in RETREAT.times
    ]
    assert {event.event.name for event in recording.events} >= {"contact X", "contact Y"}
    assert len(located) >= 2
    # SciPy locates to 4 ε in time on an interpolant of seventh order.
    assert located == pytest.approx(instants, abs=1e-9)
    np.testing.assert_allclose(recording.final_state, state, rtol=1e-7, atol=1e-9)
