"""The hypotheses under which adaptation is usually proved stable, one by one, for a study's run.

Each is proved (exact computation), checked (seen in this run), assumed, or violated, with the
number that decides. Sources: [AW 5.7, 5.8]; Narendra & Annaswamy (1989); Ioannou & Sun (1996).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from flint import fmpq_poly

from mrac_design.assessment.mismatch import InertiaMismatch
from mrac_design.assessment.signals import (
    AdaptationSignals,
    Excitation,
    adaptation_signals,
    excitation,
    rms,
)
from mrac_design.polynomials.rationals import decimal_rational
from mrac_design.polynomials.stable import is_hurwitz
from mrac_design.simulation.trajectory import Trajectory
from mrac_design.stability import (
    Hypothesis,
    StabilityCertificate,
    Status,
    positive_real,
    strictly_positive_real,
)
from mrac_design.stability.hypotheses import decided, hypotheses_markdown
from mrac_design.stability.positive_real import PositiveRealness
from mrac_design.stability.rational_function import to_float
from mrac_design.study import StudyRecord
from mrac_design.time_domain import Continuous
from mrac_design.verdict import Verdict

REBUILT_TOLERANCE = 0.1
"""Largest rms difference, relative to ε itself, between the recorded ε and the rebuilt one.

The recording is read as piecewise linear, which costs a few per cent of a millinewton."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Assessment:
    """The hypotheses of one variant of a study, and the signals behind them."""

    variant: str
    """The variant judged."""
    hypotheses: tuple[Hypothesis, ...]
    """One by one."""
    signals: tuple[AdaptationSignals, ...]
    """What the adaptation of each axis saw."""
    excitation: tuple[Excitation, ...]
    """Excitation of each axis."""

    def __getitem__(self, name: str) -> Hypothesis:
        """The hypothesis of a name; KeyError if there is none."""
        found = {item.name: item for item in self.hypotheses}
        return found[name]

    def _repr_markdown_(self) -> str:
        return hypotheses_markdown(self.hypotheses)


def assess(
    study: StudyRecord,
    *,
    variant: str,
    window: float,
    certificate: StabilityCertificate,
    mismatch: InertiaMismatch,
) -> Assessment:
    """Judge every hypothesis for one `variant` of a study.

    `window` (s) is the length of a window of persistent excitation, `certificate` the one whose
    box the gains are compared with, `mismatch` that of the scenario's own model error.
    """
    trajectory = study.trajectories[variant]
    signals = adaptation_signals(
        trajectory, study.design, settling=study.scenario.simulation.settling
    )
    excited = tuple(excitation(part, window=window) for part in signals)
    return Assessment(
        variant=variant,
        hypotheses=(
            *_plant_hypotheses(study),
            *_law_hypotheses(study, signals),
            _excitation(study, excited),
            _no_disturbance(study, signals),
            _gains_in_box(signals, certificate),
            *_robot_hypotheses(study, trajectory, certificate, mismatch),
            _sampling(study),
            _measurement(study),
        ),
        signals=signals,
        excitation=excited,
    )


def _plant_hypotheses(study: StudyRecord) -> tuple[Hypothesis, ...]:
    plant = positive_real(study.plant.transfer_function())
    error_model = strictly_positive_real([study.plant.b0], [1])
    true, assumed = study.scenario.stiffness, study.plant.stiffness
    known = true == assumed
    G = plant.function
    common = int(G.cancelled.degree())
    return (
        decided(
            "relative degree",
            G.relative_degree == 2,
            f"{G.relative_degree}, the 2 that R, S, T and the filters are made for",
        ),
        decided("A and B coprime", common == 0, f"common factor of degree {common}"),
        decided("minimum phase", G.numerator.degree() <= 0, "the plant has no zeros"),
        decided("sign of b0", true > 0, f"b0 = Ks = {true:g} N/m in this scenario, > 0"),
        Hypothesis(
            name="b0 known",
            status=Status.CHECKED if known else Status.VIOLATED,
            evidence=(
                f"design {assumed:g} N/m, true {true:g} N/m"
                + ("; nothing enforces it on real tissue" if known else "")
            ),
        ),
        _stable_polynomials(study),
        decided(
            "error model strictly positive real",
            error_model.verdict is Verdict.PROVED,
            f"Q = Ao Am makes it the constant b0; {_short(error_model)}",
        ),
    )


def _law_hypotheses(
    study: StudyRecord, signals: Sequence[AdaptationSignals]
) -> tuple[Hypothesis, ...]:
    adaptation = study.scenario.adaptation
    normalised = adaptation.law == "normalised"
    worst = max(signals, key=lambda part: rms(part.augmented_error - part.rebuilt_error))
    size, gap = rms(worst.augmented_error), rms(worst.augmented_error - worst.rebuilt_error)
    if not isinstance(study.scenario.sampling, Continuous):
        augmented = Hypothesis(
            name="augmented error",
            status=Status.ASSUMED,
            evidence="rebuilt from recordings for continuous controllers only",
        )
    else:
        augmented = Hypothesis(
            name="augmented error",
            status=Status.CHECKED if gap <= REBUILT_TOLERANCE * size else Status.VIOLATED,
            evidence=(
                f"(y − ym) + b0 η rebuilt from the recorded force and command agrees with the ε "
                f"in use to {1e3 * gap:.2g} mN of {1e3 * size:.2g} mN rms (axis {worst.axis})"
            ),
        )
    return (
        augmented,
        decided(
            "normalisation",
            normalised,
            f"dθ̂/dt is divided by α + φ̂ᵀφ̂, α = {adaptation.normalisation:g} N²"
            if normalised
            else "the plain gradient law is not normalised",
        ),
    )


def _excitation(study: StudyRecord, excited: Sequence[Excitation]) -> Hypothesis:
    """Violated when even the level found would take longer than the run to show in the gains."""
    worst = min(excited, key=lambda item: item.smallest)
    adaptation, duration = study.scenario.adaptation, study.scenario.simulation.duration
    rate = adaptation.gain * study.scenario.design.bandwidth * worst.smallest
    if adaptation.law == "normalised":
        rate /= adaptation.normalisation + worst.mean_square
    time = 1 / rate if rate > 0 else float("inf")
    return Hypothesis(
        name="persistent excitation",
        status=Status.CHECKED if time < duration else Status.VIOLATED,
        evidence=(
            f"least eigenvalue of the Gram matrix over any {worst.window:g} s is "
            f"{worst.smallest:.2g} N², the greatest {worst.largest:.3g} N² (axis {worst.axis}): "
            f"the gains would need {_long(time)} to converge, the run has {duration:g} s"
        ),
    )


def _long(seconds: float) -> str:
    """A time in s, or in hours when it is that long."""
    return f"{seconds:.2g} s" if seconds < 3600 else f"{seconds / 3600:.3g} hours"


def _no_disturbance(study: StudyRecord, signals: Sequence[AdaptationSignals]) -> Hypothesis:
    peak = 1e3 * float(np.max(study.motion.peak_to_peak))
    if peak == 0:
        return decided("no disturbance", True, "the heart does not move")
    worst = max(signals, key=lambda part: rms(part.from_heart))
    return Hypothesis(
        name="no disturbance",
        status=Status.VIOLATED,
        evidence=(
            f"the heart moves by {peak:.3g} mm peak to peak; its part of ε is "
            f"{1e3 * rms(worst.from_heart):.2g} mN rms, {worst.disturbance_share:.2g} times ε "
            f"itself (axis {worst.axis})"
        ),
    )


def _gains_in_box(
    signals: Sequence[AdaptationSignals], certificate: StabilityCertificate
) -> Hypothesis:
    lower, upper = (
        np.array([to_float(v) for v in side])
        for side in (certificate.box.lower, certificate.box.upper)
    )
    nominal = np.array([to_float(v) for v in certificate.loop.scaled_gains])
    paths = np.vstack([part.gains[:, : len(nominal)] for part in signals])
    inside = bool(((paths >= lower) & (paths <= upper)).all())
    farthest = float(np.abs(paths / nominal - 1).max())
    allowed = float(np.abs(upper / nominal - 1).max())
    return Hypothesis(
        name="gains inside the certified box",
        status=Status.CHECKED if inside else Status.VIOLATED,
        evidence=(
            f"the feedback gains stay within ±{100 * farthest:.3g} % of nominal in this run, the "
            f"box is ±{100 * allowed:.3g} %; only a projection makes sure of it"
        ),
    )


def _robot_hypotheses(
    study: StudyRecord,
    trajectory: Trajectory,
    certificate: StabilityCertificate,
    mismatch: InertiaMismatch,
) -> tuple[Hypothesis, ...]:
    limits = np.asarray(study.robot.motor_torque_limits)
    peaks = np.abs(trajectory["torque"]).max(axis=0)
    use = float((peaks / limits).max())
    motor = study.robot.joints[int(np.argmax(peaks / limits))].name
    error = study.scenario.model_error
    perfect = error.body_scale == error.first_joint_scale == 1
    friction = study.scenario.friction.scale
    limit = study.scenario.simulation.condition_limit
    return (
        Hypothesis(
            name="no saturation",
            status=Status.CHECKED if use < 1 else Status.VIOLATED,
            evidence=f"largest torque {100 * use:.3g} % of its limit ({motor})",
        ),
        Hypothesis(
            name="exact linearisation",
            status=Status.CHECKED if perfect and friction == 0 else Status.VIOLATED,
            evidence=(
                "the controller's model is the true robot, which has no friction here"
                if perfect and friction == 0
                else _inexact(certificate, mismatch, friction)
            ),
        ),
        Hypothesis(
            name="away from singular postures",
            status=Status.CHECKED if study.worst_condition <= limit else Status.VIOLATED,
            evidence=f"condition number at most {study.worst_condition:.3g}, limit {limit:g}",
        ),
    )


def _inexact(certificate: StabilityCertificate, mismatch: InertiaMismatch, friction: float) -> str:
    covered = mismatch.largest <= certificate.tolerated_mismatch
    text = (
        f"inertia mismatch up to {100 * mismatch.largest:.3g} % on {len(mismatch.norms)} postures; "
        f"the certificate tolerates {100 * certificate.tolerated_mismatch:.3g} %, "
        f"{'enough' if covered else 'too little'}"
    )
    return text + (f"; friction {friction:g} times the robot file's" if friction else "")


def _sampling(study: StudyRecord) -> Hypothesis:
    sampling = study.scenario.sampling
    if isinstance(sampling, Continuous):
        step = study.scenario.simulation.step
        return Hypothesis(
            name="continuous time",
            status=Status.ASSUMED,
            evidence=(
                f"this run is continuous, integrated in steps of {1e6 * step:g} µs; "
                "a processor samples"
            ),
        )
    return Hypothesis(
        name="continuous time",
        status=Status.VIOLATED,
        evidence=f"sampled at {sampling.rate:g} Hz, {sampling.delay} samples late",
    )


def _measurement(study: StudyRecord) -> Hypothesis:
    sampling = study.scenario.sampling
    if isinstance(sampling, Continuous):
        return Hypothesis(
            name="force measured without noise",
            status=Status.ASSUMED,
            evidence="no sensor noise in this run; a sensor of this kind has 5 to 10 mN",
        )
    noise = sampling.force_sensor.noise
    return Hypothesis(
        name="force measured without noise",
        status=Status.VIOLATED if noise > 0 else Status.ASSUMED,
        evidence=f"sensor noise of {1e3 * noise:.3g} mN rms in this run",
    )


def _stable_polynomials(study: StudyRecord) -> Hypothesis:
    specification = study.design.specification
    model = specification.reference_model
    Ao = fmpq_poly([decimal_rational(value) for value in reversed(specification.observer)])
    coefficients = ", ".join(f"{value:g}" for value in specification.observer)
    return decided(
        "Ao and Am stable",
        is_hurwitz(Ao * model.exact_polynomial),
        f"Ao with coefficients {coefficients}; Am with ω = {model.bandwidth:g} rad/s, "
        f"ξ = {model.damping:g}",
    )


def _short(judged: PositiveRealness) -> str:
    return f"inf Re = {judged.margin:g}"
