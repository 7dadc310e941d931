"""C programs of hybrid systems, written once for all processes."""

from __future__ import annotations

import pickle

import casadi as ca

from mrac_design.derivation_cache import casadi_release, derived_text
from mrac_design.simulation.method import Method
from mrac_design.simulation.system import HybridSystem


def kept_c_program(
    system: HybridSystem,
    method: Method,
    *,
    input_powers: int,
    lanes: int = 1,
    reduction: ca.Function | None = None,
) -> str:
    """What `c_program` writes for these arguments."""

    def derive() -> str:
        # With all of code generation: not loaded for a program that is there.
        from mrac_design.simulation.program import c_program

        return c_program(
            system, method, input_powers=input_powers, lanes=lanes, reduction=reduction
        )

    content = pickle.dumps((system, method, input_powers, lanes, reduction))
    return derived_text(("codegen", "simulation"), casadi_release(), content, derive)
