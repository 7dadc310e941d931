"""A mass on one axis under a contact law or friction: small enough for closed forms."""

from __future__ import annotations

import casadi as ca
import numpy as np

from mrac_design.layout import Layout
from mrac_design.motion.signal import PiecewisePolynomial, stack
from mrac_design.simulation.contact import Contact, Touch
from mrac_design.simulation.engine import build_engine
from mrac_design.simulation.run import RunSettings, run
from mrac_design.simulation.system import ARGUMENT_NAMES, HybridSystem
from mrac_design.simulation.tableau import RK4


def constant(value: float, end: float) -> PiecewisePolynomial:
    return PiecewisePolynomial(breakpoints=np.array([0.0, end]), coefficients=np.array([[[value]]]))


def pressed_mass(
    contact: Contact,
    *,
    mass: float,
    push: float,
    heart: PiecewisePolynomial,
    start: float = 0.0,
    speed: float = 0.0,
    step: float = 1e-4,
) -> dict[str, np.ndarray]:
    """m ẍ = push − Fe from `start` (m) at `speed` (m/s): time, position, force and depth."""
    state, held = Layout((("position", 1), ("velocity", 1))), Layout(())
    inputs = Layout((("heart", 1), *contact.inputs(1).blocks))
    values = {"mass": mass, "push": push, **contact.values(1)}
    parameters = Layout(tuple((name, int(np.size(value))) for name, value in values.items()))
    arguments = [
        layout.symbols(name)
        for layout, name in zip((state, held, inputs, parameters), "xzvp", strict=True)
    ]
    x, v, p = state.split(arguments[0]), inputs.split(arguments[2]), parameters.split(arguments[3])
    depth = x["position"] - v["heart"]
    force = contact.force(Touch(depth=depth, velocity=x["velocity"], inputs=v, parameters=p))

    def function(name: str, result: ca.SX) -> ca.Function:
        return ca.Function(name, arguments, [result], list(ARGUMENT_NAMES), [name])

    system = HybridSystem(
        state=state,
        held=held,
        inputs=inputs,
        parameters=parameters,
        outputs=Layout((("position", 1), ("velocity", 1), ("force", 1), ("depth", 1))),
        rate=function("rate", ca.vertcat(x["velocity"], (p["push"] - force) / p["mass"])),
        output=function("output", ca.vertcat(arguments[0], force, depth)),
    )
    exogenous = stack(heart, *contact.exogenous(heart))
    recording = run(
        build_engine(system, RK4, input_powers=exogenous.degree + 1),
        system,
        inputs=exogenous,
        parameters=parameters.pack(values),
        initial_state=np.array([start, speed]),
        settings=RunSettings(duration=heart.end, step=step, record_period=1e-3),
    )
    outputs = system.outputs.split(np.asarray(recording.outputs))
    return {"time": recording.time, **{name: value[:, 0] for name, value in outputs.items()}}
