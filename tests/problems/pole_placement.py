"""Pole-placement problems with their printed solutions and where they are printed."""

from __future__ import annotations

from dataclasses import dataclass

from flint import fmpq_poly

from mrac_design.design import (
    CancelWellDamped,
    FollowModel,
    KeepZeros,
    PolePlacement,
    UnitStaticGain,
    WellDampedRegion,
    integrator,
)
from mrac_design.plant import Process
from mrac_design.polynomials import exact_polynomial
from mrac_design.time_domain import Continuous, Discrete


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvedProblem:
    name: str
    citation: str
    placement: PolePlacement
    R: list[float]
    S: list[float]
    T: list[float] | None
    """None where the source gives no T."""
    tolerance: float
    """Absolute; 0 where the printed solution is exact, else from the digits printed."""


def _poly(*values) -> fmpq_poly:
    return exact_polynomial(values)


# The zero at −0.847 rings (damping 0.05), which the book accepts to make the point.
ALMOST_ANY_STABLE_ZERO = WellDampedRegion(damping=0.05, decay_rate=0.0)
SAMPLED_MOTOR = Process.of(
    A=["1", "-1.6065", "0.6065"], B=["0.1065", "0.0902"], domain=Discrete(0.5)
)
SAMPLED_MODEL = _poly("1", "-1.3205", "0.4966")

PROBLEMS = (
    SolvedProblem(
        name="motor, zero cancelled",
        citation="Åström & Wittenmark, Adaptive Control, 2nd ed., Example 3.1",
        placement=PolePlacement(
            process=SAMPLED_MOTOR,
            Am=SAMPLED_MODEL,
            Ao=_poly(1),
            zeros=CancelWellDamped(region=ALMOST_ANY_STABLE_ZERO),
            tracking=FollowModel(Bm=_poly("0.1761", 0)),
        ),
        R=[1.0, 0.8467],
        S=[2.6852, -1.0321],
        T=[1.6531, 0.0],
        tolerance=5e-4,  # the plant is printed with four digits, 1/0.1065 amplifies them
    ),
    SolvedProblem(
        name="motor, zero kept",
        citation="Åström & Wittenmark, Adaptive Control, 2nd ed., Example 3.2",
        placement=PolePlacement(
            process=SAMPLED_MOTOR,
            Am=SAMPLED_MODEL,
            Ao=_poly(1, 0),
            zeros=KeepZeros(),
            tracking=UnitStaticGain(),
        ),
        R=[1.0, 0.1111],
        S=[1.6422, -0.7471],
        T=[0.8951, 0.0],
        tolerance=1e-3,
    ),
    SolvedProblem(
        name="second-order process, continuous",
        citation="Åström & Wittenmark, Adaptive Control, 2nd ed., Example 5.14 (k=2, a=1)",
        placement=PolePlacement(
            process=Process.of(A=[1, 1, 0], B=2, domain=Continuous()),
            Am=_poly(1, "1.4", 1),
            Ao=_poly(1, 2),
            zeros=KeepZeros(),
            tracking=FollowModel(Bm=_poly(1)),
        ),
        R=[1.0, 2.4],
        S=[0.7, 1.0],
        T=[0.5, 1.0],
        tolerance=0.0,
    ),
    SolvedProblem(
        name="deadbeat by the Diophantine equation",
        citation="Ogata, Discrete-Time Control Systems, 2nd ed., Example 7-1",
        placement=PolePlacement(
            process=Process.of(A=[1, 1, "0.5"], B=[1, 2], domain=Discrete(1.0)),
            Am=_poly(1, 0, 0),
            Ao=_poly(1, 0),
            zeros=KeepZeros(),
            tracking=UnitStaticGain(),
        ),
        R=[1.0, -1.2],
        S=[0.2, 0.3],
        T=None,
        tolerance=0.0,
    ),
    SolvedProblem(
        name="pole assignment by comparing coefficients",
        citation="Goodwin, Graebe, Salgado, Control System Design, ch. 7 (polynomial approach)",
        placement=PolePlacement(
            process=Process.of(A=[1, 4, 3], B=3, domain=Continuous()),
            Am=_poly(1, 5, 16),
            Ao=_poly(1, 40),
            zeros=KeepZeros(),
            tracking=UnitStaticGain(),
        ),
        R=[1.0, 41.0],
        S=[49 / 3, 517 / 3],
        T=None,
        tolerance=0.0,
    ),
    SolvedProblem(
        name="double integrator, deadbeat",
        citation=(
            "sampled double integrator of Åström & Wittenmark, Computer-Controlled Systems, "
            "3rd ed., ch. 5; (q−1)²(q + 3/4) + ½(q+1)(5/2 q − 3/2) = q³ by hand"
        ),
        placement=PolePlacement(
            process=Process.of(A=[1, -2, 1], B=["0.5", "0.5"], domain=Discrete(1.0)),
            Am=_poly(1, 0, 0),
            Ao=_poly(1, 0),
            zeros=KeepZeros(),
            tracking=UnitStaticGain(),
        ),
        R=[1.0, 0.75],
        S=[2.5, -1.5],
        T=[1.0, 0.0],
        tolerance=0.0,
    ),
    SolvedProblem(
        name="PI control of a first-order process",
        citation=(
            "Åström & Hägglund, PID Controllers, 2nd ed., §4.4: K = (2ζωT − 1)/Kp, "
            "K/Ti = ω²T/Kp for Kp/(1 + sT); here Kp = 3, T = 2, ζ = 0.7, ω = 5"
        ),
        placement=PolePlacement(
            process=Process.of(A=[2, 1], B=3, domain=Continuous()),
            Am=_poly(1, 7, 25),
            Ao=_poly(1),
            zeros=KeepZeros(),
            tracking=UnitStaticGain(),
            fixed_R=integrator(Continuous()),
        ),
        R=[1.0, 0.0],
        S=[13 / 3, 50 / 3],
        T=[50 / 3],
        tolerance=0.0,
    ),
)
