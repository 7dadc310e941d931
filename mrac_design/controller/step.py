"""What a controller of one force axis is to everything that runs, ships or analyses it."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from mrac_design.arrays import FloatArray
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.time_domain import Continuous, Discrete, TimeDomain

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
    time_domain: TimeDomain
    """Continuous, or sampled with a period: what `next` means."""
    events: Layout = _NO_EVENTS
    """Names of what it measures beside the force; empty for a pure force controller."""


def require_domain(step: ControllerStep, domain: TimeDomain) -> None:
    """Raise ParameterError unless `step` was built for `domain`, and to a millionth its period."""
    own = step.time_domain
    if isinstance(domain, Discrete) and isinstance(own, Discrete):
        same = abs(own.period - domain.period) <= 1e-6 * domain.period
    else:
        same = type(own) is type(domain)
    if not same:
        raise ParameterError(
            "controller", _words(own), f"the loop is {_words(domain)}: build the controller for it"
        )


def _words(domain: TimeDomain) -> str:
    if isinstance(domain, Continuous):
        return "in continuous time"
    return f"sampled every {domain.period:g} s"
