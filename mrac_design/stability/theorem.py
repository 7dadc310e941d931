"""What the stability theorems of the literature cover for the adaptive force loop.

[AW] Theorem 5.9 adapts one feedforward gain in front of a stable G = G1 G2 with G1 strictly
positive real, using the augmented error. The loop of [Z] adapts five gains of an output feedback
around an integrating plant under a disturbance, so each hypothesis is set against the loop here.
"""

from __future__ import annotations

from dataclasses import dataclass

from flint import fmpq_poly

from mrac_design.polynomials.stable import half_plane_distribution
from mrac_design.stability.certificate import StabilityCertificate
from mrac_design.stability.factorisation import Factorisation
from mrac_design.stability.hypotheses import (
    Hypothesis,
    Status,
    decided,
    first_violated,
    hypotheses_markdown,
)
from mrac_design.stability.positive_real import PositiveRealness
from mrac_design.stability.rational_function import to_float
from mrac_design.stability.sampled_loop import Sampling
from mrac_design.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class TheoremCoverage:
    """A theorem set against a loop, hypothesis by hypothesis."""

    theorem: str
    """The theorem and where it stands."""
    conclusion: str
    """What it would give."""
    hypotheses: tuple[Hypothesis, ...]
    """Its hypotheses and how they stand for this loop."""

    @property
    def verdict(self) -> Verdict:
        """PROVED if every hypothesis is proved, REFUTED if one is violated, else UNDECIDED."""
        if first_violated(self.hypotheses) is not None:
            return Verdict.REFUTED
        proved = all(item.status is Status.PROVED for item in self.hypotheses)
        return Verdict.PROVED if proved else Verdict.UNDECIDED

    @property
    def summary(self) -> str:
        """One sentence: whether the theorem covers the loop and, if not, why."""
        if self.verdict is Verdict.PROVED:
            return f"{self.theorem} covers this loop: {self.conclusion}."
        violated = [item.name for item in self.hypotheses if not item.holds]
        if violated:
            return f"{self.theorem} does not cover this loop: {'; '.join(violated)} violated."
        open_points = [item.name for item in self.hypotheses if item.status is not Status.PROVED]
        return f"{self.theorem} covers this loop as far as {'; '.join(open_points)}."

    def _repr_markdown_(self) -> str:
        return (
            f"**{self.summary}**\n\nIt would give: {self.conclusion}.\n\n"
            f"{hypotheses_markdown(self.hypotheses)}"
        )


def feedforward_theorem(chosen: Factorisation, plant: PositiveRealness) -> TheoremCoverage:
    """[AW] Theorem 5.9 against the loop of [Z], with the chosen splitting G = G1 G2.

    `plant` is any judgement of the force plant Ks/(p(p + K2)); its exact poles are used.
    """
    poles = plant.boundary.poles
    unstable = poles.boundary + poles.outside
    hypotheses = (
        Hypothesis(
            name="one adapted feedforward gain",
            status=Status.VIOLATED,
            evidence="five gains are adapted, r1', s0 and s1 of them in the feedback path",
        ),
        decided(
            "G stable",
            unstable == 0,
            f"{unstable} of {plant.function.denominator.degree()} poles of G not in Re s < 0",
        ),
        decided(
            "G1 strictly positive real",
            chosen.strict.verdict is Verdict.PROVED,
            f"G1 of {chosen.name}: {chosen.strict.reason}",
        ),
        decided(
            "G2 stable",
            chosen.second_stable,
            f"G2 of {chosen.name} is {'' if chosen.second_stable else 'not '}strictly stable",
        ),
        _no_disturbance(),
        _ideal_actuation(),
    )
    return TheoremCoverage(
        theorem="Theorem 5.9 of Åström and Wittenmark",
        conclusion="the augmented error and the model error go to zero",
        hypotheses=hypotheses,
    )


def augmented_error_argument(
    plant: PositiveRealness, error_model: PositiveRealness
) -> TheoremCoverage:
    """The Lyapunov argument that does fit the loop's adaptation law [AW 5.8].

    With ε = b0 φᵀ(θ⁰ − θ) and dθ/dt = Γ φ ε, V = ½ θ̃ᵀ Γ⁻¹ θ̃ has dV/dt = −ε²/b0. `error_model` is
    the judgement of b0 Q/(Ao Am), which is the constant b0 for Q = Ao Am.
    """
    G = plant.function
    gain = G.high_frequency_gain
    common = int(G.cancelled.degree())
    hypotheses = (
        decided("relative degree known", True, f"relative degree {G.relative_degree}"),
        decided(
            "A and B coprime", common == 0, f"common factor of degree {common} in A and B as given"
        ),
        _minimum_phase(G.numerator),
        decided("b0 > 0", bool(gain > 0), f"high-frequency gain {to_float(gain):.6g}"),
        Hypothesis(
            name="b0 known where the augmented error is formed",
            status=Status.ASSUMED,
            evidence="the design stiffness stands for the true one",
        ),
        decided(
            "error model strictly positive real",
            error_model.verdict is Verdict.PROVED,
            error_model.reason,
        ),
        _no_disturbance(),
        _ideal_actuation(),
    )
    return TheoremCoverage(
        theorem="The Lyapunov argument for the augmented error",
        conclusion=(
            "the gains stay bounded and ε is square integrable; bounded signals and e → 0 need "
            "the normalised law as well"
        ),
        hypotheses=hypotheses,
    )


def certified_loop(certificate: StabilityCertificate) -> TheoremCoverage:
    """What the common Lyapunov function of a certificate asks for, and what it gives."""
    low, high = (
        to_float(ratio * certificate.loop.design_stiffness)
        for ratio in certificate.box.stiffness_ratio
    )
    failure = certificate.verify()
    proved = certificate.verdict is Verdict.PROVED and failure is None
    hypotheses = (
        decided("common Lyapunov function over the box", proved, failure or certificate.reason),
        Hypothesis(
            name="gains stay in the box",
            status=Status.ASSUMED,
            evidence="holds by construction when the law projects to the box",
        ),
        Hypothesis(
            name="stiffness in its range",
            status=Status.ASSUMED,
            evidence=f"{low:.6g} to {high:.6g} N/m, as stated by the engineer",
        ),
        _timing(certificate),
        Hypothesis(
            name="each axis linearised to Ẍ = u − K2 Ẋ",
            status=Status.ASSUMED,
            evidence=_linearisation(certificate),
        ),
        Hypothesis(
            name="the command is applied without saturation",
            status=Status.ASSUMED,
            evidence="compare the simulated torques with their limits",
        ),
    )
    return TheoremCoverage(
        theorem="The common Lyapunov function",
        conclusion=(
            "exponential stability for every path of the gains, and bounded force for a bounded "
            "heart motion"
        ),
        hypotheses=hypotheses,
    )


def _timing(certificate: StabilityCertificate) -> Hypothesis:
    timing = certificate.timing
    if not isinstance(timing, Sampling):
        return Hypothesis(
            name="sampling", status=Status.ASSUMED, evidence="the law runs in continuous time"
        )
    return Hypothesis(
        name="sampling",
        status=Status.PROVED,
        evidence=f"sampled at {to_float(1 / timing.period):.6g} Hz, delay of {timing.delay} "
        "periods, as the processor runs it",
    )


def _linearisation(certificate: StabilityCertificate) -> str:
    if certificate.mismatch is None:
        return "exact linearisation by the robot's model"
    percent = 100 * certificate.tolerated_mismatch
    return f"an inertia mismatch up to {percent:.3g} % between the axes keeps stability"


def _minimum_phase(numerator: fmpq_poly) -> Hypothesis:
    zeros = half_plane_distribution(numerator)
    count = numerator.degree()
    evidence = "no zeros" if count == 0 else f"{zeros.inside} of {count} zeros in Re s < 0"
    return decided("minimum phase", zeros.stable, evidence)


def _no_disturbance() -> Hypothesis:
    return Hypothesis(
        name="no disturbance",
        status=Status.VIOLATED,
        evidence="the heart's motion enters the force as d = −Ks Xh",
    )


def _ideal_actuation() -> Hypothesis:
    return Hypothesis(
        name="the command is applied as computed",
        status=Status.ASSUMED,
        evidence="no saturation, no sampling, exact linearisation of the robot",
    )
