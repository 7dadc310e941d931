"""What the simulator integrates: a continuous state, a held memory, inputs and parameters."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from mrac_design.layout import Layout


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HybridSystem:
    """Ordinary differential equations with a memory that changes at sampling instants only.

        x' = rate(state, held, input, parameters)       between sampling instants
        held⁺ = update(state, held, input, parameters)  at sampling instants
        y = output(state, held, input, parameters)      at recording instants

    A continuous controller has an empty memory and no update.
    """

    state: Layout
    """Entries of the continuous state."""
    held: Layout
    """Entries of the memory held between sampling instants."""
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
    """CasADi SX function, see above; output `next_held` of shape (held.size,)."""
    sampling_period: float | None = None
    """Time between updates (s); given exactly when there is an update."""

    def __post_init__(self) -> None:
        assert (self.update is None) == (self.sampling_period is None)

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
