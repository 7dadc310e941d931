"""What is run for half an hour: laws without and within safeguards, motions, force programmes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from mrac_design.errors import ParameterError
from mrac_design.motion import square_wave
from mrac_design.motion.reference import constant_force
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.safeguards import (
    DeadZone,
    ErrorLeakage,
    Leakage,
    Projection,
    Safeguard,
)

MINUTE = 60.0
"""s."""
STILL = "still"
"""The motion of a heart that does not move."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardedLaw:
    """The scenario's normalised law inside safeguards."""

    name: str
    """Key in files."""
    title: str
    """Name for people."""
    safeguards: tuple[Safeguard, ...]
    """Wrappers, the first one innermost; none for the plain law."""


PLAIN = GuardedLaw(name="plain", title="no safeguard", safeguards=())
"""The law as it is."""
GUARDED = (
    GuardedLaw(name="dead_zone", title="dead zone", safeguards=(DeadZone(width=0.1),)),
    GuardedLaw(name="leakage", title="σ leakage", safeguards=(Leakage(rate=5.0),)),
    GuardedLaw(
        name="error_leakage", title="e-modification", safeguards=(ErrorLeakage(rate=100.0),)
    ),
    GuardedLaw(
        name="projection", title="projection", safeguards=(Projection(share=0.05, bias=0.05),)
    ),
    GuardedLaw(
        name="together",
        title="leakage and projection",
        safeguards=(Leakage(rate=1.0), Projection(share=0.05, bias=0.05)),
    ),
)
"""Every safeguard, and the pair the scenario `reality_degree_one` wears."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Programme:
    """What is asked of the axis, minute by minute."""

    rest: float
    """Force while it rests (N)."""
    cycle: int
    """Minutes of rest and work together; work comes last."""
    work: int
    """Minutes of work in a cycle, under steps; 0 rests for ever."""
    low: float
    """Lower force of the steps (N)."""
    high: float
    """Upper force of the steps (N)."""
    half_period: float
    """Time between steps (s)."""

    def __post_init__(self) -> None:
        if not 0 <= self.work <= self.cycle or self.cycle < 1:
            raise ParameterError("work", self.work, f"must be 0 to the cycle's {self.cycle} min")

    def works(self, minute: int) -> bool:
        """Whether minute 0, 1, … is one of work."""
        return minute % self.cycle >= self.cycle - self.work

    def reference(self, minute: int) -> PiecewisePolynomial:
        """Force reference of that minute (N), over [0, 60] s."""
        if not self.works(minute):
            return constant_force(self.rest).piecewise(MINUTE)
        steps = square_wave(
            first=self.low,
            second=self.high,
            half_period=self.half_period,
            first_switch=self.half_period,
            duration=MINUTE,
        )
        return steps.piecewise(MINUTE)


REST_AND_WORK = Programme(rest=0.0, cycle=5, work=1, low=1.0, high=2.0, half_period=3.0)
"""Four minutes at zero force, one of steps between 1 and 2 N."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriftCase:
    """One condition to run."""

    law: GuardedLaw
    """The law."""
    motion: str
    """Packaged heart motion, or STILL."""
    programme: Programme
    """What is asked."""


def guarded_cases(
    motions: Sequence[str], programme: Programme = REST_AND_WORK
) -> tuple[DriftCase, ...]:
    """The plain law and every guarded one under each motion."""
    plain = DriftCase(law=PLAIN, motion=STILL, programme=programme)
    return tuple(
        replace(plain, law=law, motion=motion) for motion in motions for law in (PLAIN, *GUARDED)
    )


def resting_cases(motions: Sequence[str], forces: Sequence[float]) -> tuple[DriftCase, ...]:
    """The plain law at rest for ever, at each force (N) under each motion."""
    return tuple(
        DriftCase(law=PLAIN, motion=motion, programme=replace(REST_AND_WORK, rest=force, work=0))
        for motion in motions
        for force in forces
    )
