r"""What the adaptation of a recorded run saw: regressor, augmented error, excitation.

Force, command and model output are recorded; the filters 1/Ao and 1/Am applied to them once more
give the regressor φ̂ = b0 D φ of every axis, and with it

- what the augmented error should have been, (y − ym) + b0 η: a check on the controller,
- its two parts, ε = φ̂ᵀ(θ̂⁰ − θ̂) + S_d d: what the gains cause and what the heart causes,
- the Gram matrices ∫ φ̂ φ̂ᵀ dt / T of persistent excitation.

Source: [AW 5.67-5.71]; persistent excitation as in [AW 2.4], Ioannou & Sun (1996), ch. 4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid
from scipy.signal import lfilter, lsim

from mrac_design.arrays import FloatArray, readonly
from mrac_design.design import RSTDesign
from mrac_design.errors import ParameterError
from mrac_design.simulation.trajectory import Trajectory

MODEL_GAINS = 5
"""Adapted gains that the error model knows: r1', s0, s1, t0, t1; a bias counts as disturbance."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AdaptationSignals:
    """One axis of a run as its adaptation saw it."""

    axis: str
    """Force axis."""
    time: FloatArray
    """Instants (s), (N,), after settling."""
    regressor: FloatArray
    """φ̂ (N), (N, 5)."""
    gains: FloatArray
    """θ̂ used, (N, 5)."""
    augmented_error: FloatArray
    """ε as recorded (N), (N,)."""
    rebuilt_error: FloatArray
    """ε rebuilt from force, model and command (N), (N,)."""
    from_gains: FloatArray
    """φ̂ᵀ(θ̂⁰ − θ̂) (N), (N,): all there would be of ε without a disturbance."""

    @property
    def from_heart(self) -> FloatArray:
        """What is left of ε (N), (N,): the disturbance."""
        return self.augmented_error - self.from_gains

    @property
    def disturbance_share(self) -> float:
        """rms of the disturbance's part over the rms of ε."""
        return rms(self.from_heart) / max(rms(self.augmented_error), np.finfo(float).tiny)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Excitation:
    """Eigenvalues of the regressor's Gram matrix over windows of one axis."""

    axis: str
    """Force axis."""
    window: float
    """Length T of a window (s)."""
    centres: FloatArray
    """Middle of every window (s), (w,)."""
    eigenvalues: FloatArray
    """Eigenvalues of ∫ φ̂ φ̂ᵀ dt / T (N²), ascending, (w, 5)."""
    mean_square: float
    """Mean of |φ̂|² over the run (N²)."""

    @property
    def smallest(self) -> float:
        """Least eigenvalue over all windows (N²): the level of excitation."""
        return float(self.eigenvalues[:, 0].min())

    @property
    def largest(self) -> float:
        """Greatest eigenvalue over all windows (N²)."""
        return float(self.eigenvalues[:, -1].max())


def adaptation_signals(
    trajectory: Trajectory, design: RSTDesign, *, settling: float
) -> tuple[AdaptationSignals, ...]:
    """The signals of every force axis, from `settling` s on.

    The recording is taken as piecewise linear. Raises ParameterError when too little is recorded.
    """
    kept = trajectory.time >= settling
    if kept.sum() < 10:
        raise ParameterError("settling", settling, "leaves fewer than ten recorded samples")
    labels = trajectory.signals["force"].labels
    count = trajectory["adapted_gains"].shape[1] // len(labels)
    return tuple(
        _axis_signals(trajectory, design, axis, i, count, kept) for i, axis in enumerate(labels)
    )


def excitation(signals: AdaptationSignals, *, window: float) -> Excitation:
    """Gram matrices over windows of `window` s that overlap by three quarters.

    Raises ParameterError when the run is shorter than a window.
    """
    length = float(signals.time[-1] - signals.time[0])
    if not 0 < window <= length:
        raise ParameterError("window", window, f"must be > 0 and at most the run's {length:g} s")
    starts = np.arange(signals.time[0], signals.time[-1] - window + 1e-9, window / 4)
    outer = signals.regressor[:, :, None] * signals.regressor[:, None, :]
    eigenvalues = []
    for start in starts:
        part = (signals.time >= start - 1e-9) & (signals.time <= start + window + 1e-9)
        gram = trapezoid(outer[part], signals.time[part], axis=0) / window
        eigenvalues.append(np.maximum(np.linalg.eigvalsh(gram), 0.0))
    return Excitation(
        axis=signals.axis,
        window=window,
        centres=readonly(starts + window / 2),
        eigenvalues=readonly(eigenvalues),
        mean_square=float(np.mean(np.sum(signals.regressor**2, axis=1))),
    )


def rms(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def _axis_signals(
    trajectory: Trajectory,
    design: RSTDesign,
    axis: str,
    index: int,
    count: int,
    kept: np.ndarray,
) -> AdaptationSignals:
    specification = design.specification
    model, ao, b0 = (
        specification.reference_model,
        specification.observer_pole,
        specification.plant.b0,
    )
    period = float(np.median(np.diff(trajectory.time)))
    omega, damping = model.bandwidth, model.damping
    force, command, model_force = (
        trajectory[name][:, index] for name in ("force", "command", "model_force")
    )
    low = _LowPass(period=period)
    xu, xy = low.first(command, ao), low.first(force, ao)
    zu1, zu2 = low.second(xu, omega, damping)
    zy1, zy2 = low.second(xy, omega, damping)
    # ym has passed Am already, so uc/(Ao Am) is ym/(ω² Ao).
    xc = low.first(model_force, ao) / omega**2
    phi = np.stack([zu2, zy1, zy2, -(model_force / omega**2 - ao * xc), -xc], axis=1)
    regressor = b0 * design.scaling[:MODEL_GAINS] * phi
    gains = trajectory["adapted_gains"][:, index * count : (index + 1) * count][:, :MODEL_GAINS]
    caused = (regressor * (design.scaled_parameters[:MODEL_GAINS] - gains)).sum(axis=1)
    augmentation = -(b0 * (zu1 + ao * zu2) + (regressor * gains).sum(axis=1))
    return AdaptationSignals(
        axis=axis,
        time=readonly(trajectory.time[kept]),
        regressor=readonly(regressor[kept]),
        gains=readonly(gains[kept]),
        augmented_error=readonly(trajectory["augmented_error"][kept, index]),
        rebuilt_error=readonly((force - model_force + augmentation)[kept]),
        from_gains=readonly(caused[kept]),
    )


@dataclass(frozen=True, slots=True)
class _LowPass:
    """Exact responses of 1/(p + a) and (p, 1)/Am to piecewise linear inputs, from rest."""

    period: float

    def first(self, values: FloatArray, pole: float) -> FloatArray:
        """Response of 1/(p + pole), which starts settled on the first value."""
        a = np.exp(-pole * self.period)
        # ∫ of the ramp from v_k to v_{k+1} against exp: two weights.
        total = (1 - a) / pole
        later = (self.period - total) / (pole * self.period)
        start = values[0] / pole
        driven = (total - later) * values[:-1] + later * values[1:]
        response, _ = lfilter([1.0], [1.0, -a], driven, zi=[a * start])
        return np.concatenate([[start], response])

    def second(
        self, values: FloatArray, omega: float, damping: float
    ) -> tuple[FloatArray, FloatArray]:
        """Responses of p/Am and 1/Am, which start settled on the first value."""
        A = [[-2 * damping * omega, -(omega**2)], [1.0, 0.0]]
        system = (A, [[1.0], [0.0]], np.eye(2), np.zeros((2, 1)))
        time = self.period * np.arange(len(values))
        start = [0.0, values[0] / omega**2]
        response = lsim(system, values, time, X0=start)[1]
        return response[:, 0], response[:, 1]
