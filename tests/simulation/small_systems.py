"""A small hybrid system with everything in it: trigonometry, division, jumps, a held memory."""

from __future__ import annotations

import casadi as ca
import numpy as np

from mrac_design.layout import Layout
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.system import ARGUMENT_NAMES, HybridSystem

STATE = Layout((("angle", 1), ("rate", 1), ("filtered", 1)))
INPUTS = Layout((("push", 1), ("carriage", 1)))
PARAMETERS = Layout((("inertia", 1), ("gravity", 1), ("damping", 1)))
PARAMETER_VALUES = np.array([0.7, 9.81, 0.3])
INITIAL_STATE = np.array([0.4, 0.0, 0.1])


def pendulum(*, sampling_period: float | None = None) -> HybridSystem:
    """A pendulum on a moving carriage with a torque; sampled, it also feels a held one."""
    held = Layout((("torque", 1), ("count", 1)) if sampling_period else ())
    outputs = Layout((("angle", 1), ("energy", 1), ("push", 1), ("held", held.size)))
    x, v, p = STATE.symbols("x"), INPUTS.symbols("v"), PARAMETERS.symbols("p")
    z = held.symbols("z")
    angle, rate, filtered = ca.vertsplit(x)
    push, carriage = ca.vertsplit(v)
    inertia, gravity, damping = ca.vertsplit(p)
    torque = push - damping * rate - gravity * ca.sin(angle) + carriage * ca.cos(angle)
    if sampling_period:
        torque += z[0]
    arguments = [x, z, v, p]
    slopes = ca.vertcat(rate, torque / (inertia + 0.1 * ca.sin(angle) ** 2), 5 * (angle - filtered))
    energy = inertia * rate**2 / 2 + gravity * (1 - ca.cos(angle))
    update = None
    if sampling_period:
        following = ca.vertcat(-0.8 * angle - 0.1 * rate / (1 + angle**2), z[1] + 1)
        update = ca.Function("update", arguments, [following], list(ARGUMENT_NAMES), ["next_held"])
    return HybridSystem(
        state=STATE,
        held=held,
        inputs=INPUTS,
        parameters=PARAMETERS,
        outputs=outputs,
        rate=ca.Function("rate", arguments, [slopes], list(ARGUMENT_NAMES), ["rate"]),
        output=ca.Function(
            "output",
            arguments,
            [ca.vertcat(angle, energy, push, z)],
            list(ARGUMENT_NAMES),
            ["output"],
        ),
        update=update,
        sampling_period=sampling_period,
    )


def pushes(*, jump: float = 0.5) -> PiecewisePolynomial:
    """A push that jumps at 0.3137 s (on no grid) by `jump`, and a carriage moving smoothly."""
    borders = np.array([0.0, 0.3137, 1.0, 2.0])
    coefficients = np.zeros((2, 3, 3))
    coefficients[0, :, 0] = [0.2, 0.2 + jump, 0.2]
    coefficients[1, 0] = [0.1, 0.4, -0.3]
    value, slope = 0.1, 0.4
    for i in range(1, 3):
        h = borders[i] - borders[i - 1]
        a, b, c = coefficients[1, i - 1]
        value, slope = a + b * h + c * h**2, b + 2 * c * h
        coefficients[1, i] = [value, slope, 0.2]
    return PiecewisePolynomial(breakpoints=borders, coefficients=coefficients)
