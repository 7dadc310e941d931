"""What the simulator integrates: a continuous state, a held memory, inputs and parameters."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import casadi as ca

from mrac_design.layout import Layout


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """What it means when an event function changes its sign."""

    name: str
    """What changes, e.g. "contact X"."""
    rising: str
    """What has happened when the function has become positive, e.g. "made"."""
    falling: str
    """What has happened when it no longer is, e.g. "lost"."""


class Kinks(Enum):
    """What integration steps do where the equations have kinks or jumps."""

    LOCATED = "located"
    """They end there, and events are told."""
    CROSSED = "crossed"
    """They go straight across, as where no program locates events."""


MODES = "modes"
"""Block of the memory with a number for each event: 1 while its function is positive, else 0."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HybridSystem:
    """Ordinary differential equations with a memory that changes at sampling instants only.

        x' = rate(state, held, input, parameters)       between sampling instants
        held⁺ = update(state, held, input, parameters)  at sampling instants
        y = output(state, held, input, parameters)      at recording instants

    A continuous controller has an empty memory and no update. Where the rate has kinks or jumps,
    event functions tell on which side of them the state is: integration steps end where one
    changes its sign, and the block `modes` of the memory, which the rate goes by, says which side
    a step belongs to. Two changes within one step that leave the sign as it was are not seen.
    """

    state: Layout
    """Entries of the continuous state."""
    held: Layout
    """Entries of the memory held between sampling instants; `modes` among them with events."""
    inputs: Layout
    """Entries of the exogenous input (piecewise polynomials of time)."""
    parameters: Layout
    """Entries of the constant parameters."""
    outputs: Layout
    """Entries of what is recorded."""
    rate: ca.Function
    """CasADi SX function, see above; output `rate` of shape (state.size,)."""
    output: ca.Function
    """CasADi SX function, see above; output `output` of shape (outputs.size,)."""
    update: ca.Function | None = None
    """CasADi SX function, see above; output `next_held` of shape (held.size,), modes as they
    were."""
    sampling_period: float | None = None
    """Time between updates (s); given exactly when there is an update."""
    events: tuple[Event, ...] = ()
    """What the event functions stand for, one each."""
    event_functions: ca.Function | None = None
    """CasADi SX function (state, held, input, parameters) → `events` of shape (len(events),);
    given exactly when there are events."""

    def __post_init__(self) -> None:
        assert (self.update is None) == (self.sampling_period is None)
        assert (self.event_functions is None) == (not self.events)
        assert dict(self.held.blocks).get(MODES, 0) == len(self.events)
        if self.event_functions is not None:
            assert self.event_functions.numel_out(0) == len(self.events)

    def arguments(self) -> list[ca.SX]:
        """Fresh symbols for (state, held, input, parameters)."""
        return [
            self.state.symbols("state"),
            self.held.symbols("held"),
            self.inputs.symbols("input"),
            self.parameters.symbols("parameters"),
        ]


ARGUMENT_NAMES = ("state", "held", "input", "parameters")
"""Names of the inputs of every function of a `HybridSystem`, in order."""
