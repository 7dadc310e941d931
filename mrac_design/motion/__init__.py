"""Exogenous inputs of a simulation: heart motion and force reference."""

from mrac_design.motion.dual_fourier import BeatVariation, Breathing, DualFourierModel
from mrac_design.motion.heart import AXES, HeartMotion, Origin
from mrac_design.motion.loading import fitted_motion, load_motion, parametric_motion
from mrac_design.motion.model_file import available_motions, find_model, names_model, read_model
from mrac_design.motion.recorded import read_recorded_motion
from mrac_design.motion.reference import (
    ForceReference,
    StepSequence,
    constant_force,
    square_wave,
)
from mrac_design.motion.rhythm import (
    JitteredRhythm,
    RegularRhythm,
    Rhythm,
    VariableRhythm,
    WithEctopicBeat,
)
from mrac_design.motion.signal import (
    PiecewisePolynomial,
    from_ppoly,
    merged_breakpoints,
    quintic_hermite,
    stack,
)

__all__ = [
    "AXES",
    "BeatVariation",
    "Breathing",
    "DualFourierModel",
    "ForceReference",
    "HeartMotion",
    "JitteredRhythm",
    "Origin",
    "PiecewisePolynomial",
    "RegularRhythm",
    "Rhythm",
    "StepSequence",
    "VariableRhythm",
    "WithEctopicBeat",
    "available_motions",
    "constant_force",
    "find_model",
    "fitted_motion",
    "from_ppoly",
    "load_motion",
    "merged_breakpoints",
    "names_model",
    "parametric_motion",
    "quintic_hermite",
    "read_model",
    "read_recorded_motion",
    "square_wave",
    "stack",
]
