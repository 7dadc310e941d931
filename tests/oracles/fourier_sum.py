"""Heart motion as a plain sum of cosines, written out term by term."""

from __future__ import annotations

import math

# Per axis: cardiac amplitudes (mm) and phases, respiratory amplitudes (mm) and phases.
TERMS = {
    "X": ((1.2, 0.7, 0.4, 0.2, 0.1), (0.6, 2.2, -1.0, 0.9, 2.5), (1.0, 0.2), (0.4, 1.5)),
    "Y": ((0.9, 0.6, 0.3, 0.2, 0.1), (2.4, -0.7, 1.6, -2.1, 0.3), (1.2, 0.3), (-0.5, 0.9)),
    "Z": ((2.6, 1.4, 0.75, 0.4, 0.2), (0.3, 1.1, 2.0, 0.4, 1.7), (2.5, 0.6), (0.0, 0.8)),
}


def displacement(axis: str, t: float, cardiac: float, respiratory: float) -> float:
    """Displacement in m at t s for the two frequencies in Hz."""
    beat, beat_phase, breath, breath_phase = TERMS[axis]
    total = 0.0
    for index, (size, phase) in enumerate(zip(beat, beat_phase, strict=True), start=1):
        total += size * math.cos(2 * math.pi * index * cardiac * t + phase)
    for index, (size, phase) in enumerate(zip(breath, breath_phase, strict=True), start=1):
        total += size * math.cos(2 * math.pi * index * respiratory * t + phase)
    return total * 1e-3
