"""Exogenous inputs of a simulation: heart motion and force reference."""

from mrac_design.motion.reference import (
    ForceReference,
    StepSequence,
    constant_force,
    square_wave,
)
from mrac_design.motion.signal import (
    PiecewisePolynomial,
    from_ppoly,
    merged_breakpoints,
    quintic_hermite,
    stack,
)

__all__ = [
    "ForceReference",
    "PiecewisePolynomial",
    "StepSequence",
    "constant_force",
    "from_ppoly",
    "merged_breakpoints",
    "quintic_hermite",
    "square_wave",
    "stack",
]
