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
from scipy.signal import lsim

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.filter_chains import chain_equations
from mrac_design.design import RSTDesign, RSTSpecification
from mrac_design.errors import ParameterError
from mrac_design.simulation.trajectory import Trajectory


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AdaptationSignals:
    """One axis of a run as its adaptation saw it."""

    axis: str
    """Force axis."""
    time: FloatArray
    """Instants (s), (N,), after settling."""
    regressor: FloatArray
    """φ̂ (N) of (r1', s0 … sn, t0 … tn), (N, 2n + 3); a bias counts as disturbance."""
    gains: FloatArray
    """θ̂ used, (N, 2n + 3)."""
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
    """Eigenvalues of ∫ φ̂ φ̂ᵀ dt / T (N²), ascending, (w, 2n + 3)."""
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
    model, b0 = specification.reference_model, specification.plant.b0
    D, c = np.array(specification.internal_model), specification.adapted_pole
    period = float(np.median(np.diff(trajectory.time)))
    force, command, model_force = (
        trajectory[name][:, index] for name in ("force", "command", "model_force")
    )
    on_command, on_force, on_model = (
        _Powers.of(specification, values, period) for values in (command, force, model_force)
    )
    modelled, driven = on_command.after_model[:, 1:] @ D, on_command.after_model[:, :-1] @ D
    # ym has passed Am already, so uc/(Ao Am) is ym/(ω² Ao).
    reference = on_model.before_model / model.bandwidth**2
    phi = np.column_stack([modelled, on_force.after_model, -reference])
    regressor = b0 * design.scaling * phi
    own = len(design.scaling)
    gains = trajectory["adapted_gains"][:, index * count : index * count + own]
    caused = (regressor * (design.scaled_parameters - gains)).sum(axis=1)
    augmentation = -(b0 * (driven + c * modelled) + (regressor * gains).sum(axis=1))
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
class _Powers:
    """Powers of p, highest first, of a filtered signal v."""

    before_model: FloatArray
    """pⁱ v/Ao for i = n … 0, (N, n + 1)."""
    after_model: FloatArray
    """pⁱ v/(Ao Am) for i = n … 0, (N, n + 1)."""

    @classmethod
    def of(cls, specification: RSTSpecification, values: FloatArray, period: float) -> _Powers:
        """Exact responses to a piecewise linear v that start settled on its first value."""
        n, (A, B) = specification.degree, chain_equations(specification)
        start = np.linalg.solve(A, -B[:, 0] * values[0])
        system = (A, B, np.eye(n + 2), np.zeros((n + 2, 1)))
        time = period * np.arange(len(values))
        states = lsim(system, values, time, X0=start)[1]
        filtered = states[:, :n]
        highest = values - filtered @ np.array(specification.observer[1:])
        damping, stiffness = specification.reference_model.polynomial[1:]
        powers = [states[:, n + 1], states[:, n]]
        for i in range(2, n + 1):  # Am z = v/Ao
            known = damping * powers[i - 1] + stiffness * powers[i - 2]
            powers.append(filtered[:, n + 1 - i] - known)
        return cls(np.column_stack([highest, filtered]), np.column_stack(powers[::-1]))
