r"""A controller together with an observer that takes the heart's motion off its hands.

    u = v − p̂(k + d | k),     v = the controller inside, told that v was applied

A Kalman filter of plant, dead time and a disturbance at the command, whose first difference is
white, gives p̂; to the controller inside, the plant then seems less disturbed. Any controller can
stand inside, an adaptive one too: its regressors hold v.
"""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.rivals.observation import (
    difference_chain,
    kalman_gain,
    sampled_plant,
)
from mrac_design.controller.step import ControllerStep
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Discrete


def with_disturbance_observer(
    step: ControllerStep,
    *,
    plant: ForcePlant,
    domain: Discrete,
    delay: int,
    drive: float,
    force_noise: float,
) -> ControllerStep:
    """`step` behind an observer of the disturbance at the command.

    `drive` (m/s²) is the standard deviation of the disturbance's change from sample to sample,
    `force_noise` (N) that of the sensor. Raises ParameterError when one of them is not positive,
    or for a controller that measures more than the force.
    """
    if not 0 < drive < float("inf"):
        raise ParameterError("drive", drive, "must be finite and > 0")
    if step.events.size:
        raise ParameterError("controller", step.events.entry_names, "must measure the force only")
    model = sampled_plant(plant, domain, delay=delay).with_disturbance(*difference_chain(1))
    gain = kalman_gain(model, np.array([[0.0], [0.0], [drive]]), force_noise)
    values: dict[str, FloatArray] = {
        "inner": step.parameter_values,
        "kalman": gain,
        "transition": readonly(np.ravel(model.transition)),
        "input": model.input,
    }
    layout = Layout((("inner", step.state.size), ("estimate", 3), ("pending", delay)))
    parameters = Layout(tuple((name, int(value.size)) for name, value in values.items()))
    x, p = layout.symbols("state"), parameters.symbols("parameters")
    force, reference, applied = (ca.SX.sym(n) for n in ("force", "reference", "applied_command"))
    state, symbols = layout.split(x), parameters.split(p)

    predicted = state["estimate"]
    filtered = predicted + symbols["kalman"] * (force - predicted[0])
    disturbance = filtered[2]
    inner = step.command(state["inner"], force, reference, symbols["inner"])
    advanced, signals = step.advance(
        state["inner"], force, reference, applied + disturbance, symbols["inner"]
    )
    waiting = ca.vertsplit(state["pending"]) if delay else []
    acting = waiting[-1] if waiting else applied
    transition = ca.reshape(symbols["transition"], 3, 3).T
    following = {
        "inner": advanced,
        "estimate": transition @ filtered + symbols["input"] * acting,
        "pending": ca.vertcat(applied, *waiting[:-1]) if delay else ca.SX(0, 1),
    }
    resting = {
        "inner": step.equilibrium(force, symbols["inner"]),
        "estimate": ca.vertcat(force, 0, 0),
        "pending": ca.SX.zeros(delay),
    }
    names = ["state", "force", "reference"]
    return replace(
        step,
        state=layout,
        parameters=parameters,
        parameter_values=parameters.pack(values),
        command=ca.Function(
            "command",
            [x, force, reference, p],
            [inner - disturbance],
            [*names, "parameters"],
            ["command"],
        ),
        advance=ca.Function(
            "advance",
            [x, force, reference, applied, p],
            [layout.join(following), signals],
            [*names, "applied_command", "parameters"],
            ["next", "signals"],
        ),
        equilibrium=ca.Function(
            "equilibrium",
            [force, p],
            [layout.join(resting)],
            ["force", "parameters"],
            ["state"],
        ),
    )
