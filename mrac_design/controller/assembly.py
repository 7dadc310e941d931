"""From symbolic expressions to a `ControllerStep`: the inputs' names and order in one place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from mrac_design.arrays import FloatArray
from mrac_design.controller.step import ControllerStep
from mrac_design.layout import Layout
from mrac_design.time_domain import TimeDomain

NO_EVENTS = Layout(())
"""For controllers that measure the force alone."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StepSymbols:
    """Symbols a controller's expressions are written in."""

    layout: Layout
    """Entries of the state."""
    parameters_layout: Layout
    """Entries of the parameters."""
    events_layout: Layout
    """Entries of what is measured beside the force."""
    state: ca.SX
    """State, (layout.size,)."""
    parameters: ca.SX
    """Parameters, (parameters_layout.size,)."""
    force: ca.SX
    """Measured force (N)."""
    reference: ca.SX
    """Force reference (N)."""
    applied: ca.SX
    """Command that was applied (m/s²)."""
    events: ca.SX
    """Further measurements, (events_layout.size,)."""

    @staticmethod
    def of(layout: Layout, parameters: Layout, events: Layout = NO_EVENTS) -> StepSymbols:
        """Fresh symbols for these layouts."""
        return StepSymbols(
            layout=layout,
            parameters_layout=parameters,
            events_layout=events,
            state=layout.symbols("state"),
            parameters=parameters.symbols("parameters"),
            force=ca.SX.sym("force"),
            reference=ca.SX.sym("reference"),
            applied=ca.SX.sym("applied_command"),
            events=events.symbols("events"),
        )


def assemble_step(
    symbols: StepSymbols,
    *,
    values: FloatArray,
    command: ca.SX,
    following: Mapping[str, ca.SX],
    signals: Mapping[str, ca.SX],
    rest: ca.SX,
    time_domain: TimeDomain,
) -> ControllerStep:
    """The step whose command, advanced state by block, signals and resting state are given.

    `following` is in `time_domain`; `values` are the parameters; `rest` is written in
    `symbols.force` and the parameters.
    """
    measured = [symbols.state, symbols.force, symbols.reference]
    names = ["state", "force", "reference"]
    reported = Layout(tuple((name, signal.numel()) for name, signal in signals.items()))
    advance_inputs = [*measured, symbols.applied, symbols.parameters]
    advance_names = [*names, "applied_command", "parameters"]
    if symbols.events_layout.size:
        advance_inputs.append(symbols.events)
        advance_names.append("events")
    return ControllerStep(
        state=symbols.layout,
        parameters=symbols.parameters_layout,
        signals=reported,
        parameter_values=values,
        command=ca.Function(
            "command",
            [*measured, symbols.parameters],
            [command],
            [*names, "parameters"],
            ["command"],
        ),
        advance=ca.Function(
            "advance",
            advance_inputs,
            [symbols.layout.join(following), reported.join(signals)],
            advance_names,
            ["next", "signals"],
        ),
        equilibrium=ca.Function(
            "equilibrium",
            [symbols.force, symbols.parameters],
            [rest],
            ["force", "parameters"],
            ["state"],
        ),
        time_domain=time_domain,
        events=symbols.events_layout,
    )
