"""What a controller of one force axis is to everything that runs, ships or analyses it."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from mrac_design.arrays import FloatArray
from mrac_design.layout import Layout

_NO_EVENTS = Layout(())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ControllerStep:
    """One axis of force control as two CasADi functions.

    The command depends on the state and the measurement only, so it is known before the actuators
    limit it; the state then advances with the command that was really *applied*:

        command(state, force, reference, parameters)                    -> command
        advance(state, force, reference, applied_command, parameters)   -> next, signals

    `next` is the state's time derivative in continuous time and its next value in discrete time.
    A controller that measures more than the force, heartbeats for instance, lists it as `events`:
    `advance` then takes a sixth argument of that size.
    """

    state: Layout
    """Names of the state's entries."""
    parameters: Layout
    """Names of the parameters' entries."""
    signals: Layout
    """Names of what `advance` reports beside the state."""
    parameter_values: FloatArray
    """Parameters as designed, shape (parameters.size,)."""
    command: ca.Function
    """(state, force N, reference N, parameters) -> command (m/s²)."""
    advance: ca.Function
    """(state, force N, reference N, applied_command m/s², parameters[, events]) -> next,
    signals."""
    equilibrium: ca.Function
    """(force N, parameters) -> the state at rest at that force and reference."""
    events: Layout = _NO_EVENTS
    """Names of what it measures beside the force; empty for a pure force controller."""
