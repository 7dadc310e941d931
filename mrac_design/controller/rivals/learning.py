"""PI force control with iterative learning over one period of the motion [Cagneau 2007].

    u(t) = Kp e + Ki ∫e + v(t),     v(t) = Q [ v(t − T) + L e(t − T + δ) ]

The memory of the last period learns what the PI controller keeps getting wrong; the zero-phase
low-pass Q decides up to which frequency. Learning converges when |Q (1 − L e^{jωδ} P)| < 1 at
every frequency, P being the closed PI loop from v to the force.
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.rivals.linear import Columns, LinearController
from mrac_design.controller.rivals.reference_rows import PREFILTER, REST, ReferenceRows
from mrac_design.design import ReferenceModel
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Discrete


@dataclass(frozen=True, slots=True, kw_only=True)
class IterativeLearning:
    """PI controller with learning, fully specified for one axis."""

    proportional: float
    """Kp ((m/s²)/N), ≥ 0."""
    integral: float
    """Ki ((m/s²)/(N·s)), ≥ 0."""
    learning: float
    """L ((m/s²)/N), ≥ 0; zero leaves the PI controller."""
    lead: int
    """δ in samples: how much later an error shows than the command that caused it."""
    repetition: int
    """Period T of the motion in samples, taken as known."""
    cutoff: float
    """Cut-off frequency of Q (Hz)."""
    half_width: int
    """Number of samples Q looks at to either side."""
    prefilter: ReferenceModel
    """Pre-filter Hm that turns force steps into the desired force [Z 5]."""
    time_domain: Discrete
    """Sampling."""

    def __post_init__(self) -> None:
        for name in ("proportional", "integral", "learning"):
            value = getattr(self, name)
            if not 0 <= value < float("inf"):
                raise ParameterError(f"{name} gain", value, "must be finite and >= 0")
        if not 0 < self.cutoff < 0.5 / self.time_domain.period:
            raise ParameterError("cut-off", self.cutoff, "must be below half the sampling rate")
        if self.lead < 0 or self.half_width < 1:
            raise ParameterError("lead", self.lead, "must be >= 0, with half_width >= 1")
        if self.repetition <= self.half_width + self.lead:
            raise ParameterError(
                "repetition", self.repetition, "must exceed Q's half width and the lead together"
            )


def zero_phase_low_pass(specification: IterativeLearning) -> FloatArray:
    """Symmetric coefficients of Q, unit gain at frequency zero, (2 half_width + 1,)."""
    shift = np.arange(-specification.half_width, specification.half_width + 1)
    ratio = 2.0 * specification.cutoff * specification.time_domain.period
    taps = np.sinc(ratio * shift) * np.hamming(shift.size)
    return readonly(taps / taps.sum())


def iterative_learning(specification: IterativeLearning) -> LinearController:
    """The controller's equations.

    The memory holds s = v + L e(· + δ), newest first; entry i is s(k − 1 − i − δ).
    """
    half, lead, period = specification.half_width, specification.lead, specification.repetition
    columns = Columns(Layout((("integral", 1), ("memory", period + half), PREFILTER)))
    reference = ReferenceRows(specification.prefilter, specification.time_domain, columns)
    error = reference.desired(ahead=0) - columns.force
    taps = zero_phase_low_pass(specification)
    memory = columns.state.slices["memory"].start

    def learned(shift: int) -> FloatArray:
        """Row of v(k − shift)."""
        row = np.zeros(columns.size)
        newest = memory + period - half - 1 - lead + shift
        row[newest : newest + taps.size] = taps
        return row

    integral = columns.block("integral")[0]
    step = specification.time_domain.period
    return LinearController(
        time_domain=specification.time_domain,
        columns=columns,
        following={
            "integral": (integral + step * error)[None, :],
            "prefilter": reference.following(),
        },
        registers={"memory": learned(lead) + specification.learning * error},
        command=specification.proportional * error + specification.integral * integral + learned(0),
        signals={"desired_force": reference.desired(ahead=0), "learned_command": learned(0)},
        rest={"integral": 0.0, "memory": 0.0, **REST},
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LearningConvergence:
    """Whether and how fast learning converges."""

    contraction: float
    """Largest |Q (1 − L e^{jωδ} P)|: by how much the worst component shrinks each period."""
    frequency: float
    """Where that is (Hz)."""
    stable_loop: bool
    """Whether the PI loop itself is stable, without which nothing converges."""

    @property
    def converges(self) -> bool:
        """Whether every component shrinks."""
        return self.stable_loop and self.contraction < 1.0


def learning_convergence(
    specification: IterativeLearning, plant: ForcePlant, *, delay: int, points: int
) -> LearningConvergence:
    """Convergence on a plant with dead time (samples), over `points` frequencies to Nyquist."""
    h = specification.time_domain.period
    G = control.c2d(plant.transfer_function(), h) * control.TransferFunction(
        [1.0], [1.0] + [0.0] * delay, h
    )
    Kp, Ki = specification.proportional, specification.integral
    # Without integral action the integrator is no part of the loop.
    C = control.TransferFunction([Kp, Ki * h - Kp], [1.0, -1.0], h) if Ki else Kp
    closed = control.feedback(G, C)
    frequency = np.linspace(0.0, 0.5 / h, points + 1)[1:]
    z = np.exp(2j * np.pi * frequency * h)
    shift = np.arange(-specification.half_width, specification.half_width + 1)
    Q = (zero_phase_low_pass(specification) * z[:, None] ** shift).sum(axis=1)
    size = np.abs(Q * (1.0 - specification.learning * z**specification.lead * closed(z)))
    worst = int(np.argmax(size))
    return LearningConvergence(
        contraction=float(size[worst]),
        frequency=float(frequency[worst]),
        stable_loop=bool((np.abs(closed.poles()) < 1.0).all()),
    )
