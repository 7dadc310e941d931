"""Ways to adapt θ from an error model, each with the equations it runs [AW §5.8].

In all of them u = −θᵀ(P1 φ), possibly with a further term, so that no signal is
differentiated; they differ in how the mismatch η = −((1/P1) u + φᵀθ), which is zero only while
θ rests, is accounted for. Each needs b0 > 0 and the stated transfer function to be strictly
positive real; whether it is, is not decided here.
"""

from __future__ import annotations

from dataclasses import dataclass

from flint import fmpq_poly

from mrac_design.design.error_model import ErrorModel
from mrac_design.errors import ParameterError


@dataclass(frozen=True, slots=True, kw_only=True)
class AugmentedError:
    """b0 known: ε = ef + G η [AW 5.75, 5.76]; then ε = G φᵀ(θ⁰ − θ)."""

    model: ErrorModel
    """G, P1, P2 and θ⁰."""

    def __post_init__(self) -> None:
        _require_positive_gain(self.model)

    @property
    def strictly_positive_real(self) -> tuple[fmpq_poly, fmpq_poly]:
        """Numerator and denominator of the transfer function that has to be SPR: G."""
        return self.model.transfer

    @property
    def equations(self) -> tuple[str, ...]:
        """What runs, in LaTeX."""
        return (
            r"u = -\theta^T (P_1\varphi)",
            r"\eta = -\left(\tfrac{1}{P_1}u + \varphi^T\theta\right)",
            r"\varepsilon = e_f + \frac{b_0 Q}{A_o A_m}\,\eta",
            r"\dot\theta = \Gamma\varphi\,\varepsilon",
        )

    def _repr_latex_(self) -> str:
        return _aligned(self.equations)


@dataclass(frozen=True, slots=True, kw_only=True)
class AugmentedErrorUnknownGain:
    """Only the sign of b0 known: b̂0 is adapted beside θ [AW 5.78–5.80].

    With ε = ef + (Q/(Ao Am)) b̂0 η one has ε = (Q/(Ao Am)) [b0 φᵀ(θ⁰ − θ) − (b0 − b̂0) η], an
    error linear in both unknowns. b̂0(0) of the wrong sign makes the loop diverge at first.
    """

    model: ErrorModel
    """G, P1, P2 and θ⁰."""

    initial_gain: float
    """b̂0(0), in the unit of b0, positive like b0."""

    def __post_init__(self) -> None:
        _require_positive_gain(self.model)
        if not self.initial_gain > 0.0:
            raise ParameterError(
                "initial gain estimate", self.initial_gain, "must have the sign of b0, positive"
            )

    @property
    def strictly_positive_real(self) -> tuple[fmpq_poly, fmpq_poly]:
        """Numerator and denominator of the transfer function that has to be SPR: Q/(Ao Am)."""
        numerator, denominator = self.model.transfer
        return numerator / self.model.b0, denominator

    @property
    def equations(self) -> tuple[str, ...]:
        """What runs, in LaTeX."""
        return (
            r"u = -\theta^T (P_1\varphi)",
            r"\eta = -\left(\tfrac{1}{P_1}u + \varphi^T\theta\right)",
            r"\varepsilon = e_f + \frac{Q}{A_o A_m}\left(\hat b_0\,\eta\right)",
            r"\dot\theta = \Gamma\varphi\,\varepsilon",
            r"\dot{\hat b}_0 = -\gamma_b\,\eta\,\varepsilon",
        )

    def _repr_latex_(self) -> str:
        return _aligned(self.equations)


@dataclass(frozen=True, slots=True, kw_only=True)
class DirectError:
    """No augmentation: u = −θᵀ(P1 φ) − (φᵀΓφ) ef keeps (1/P1) u = −φᵀθ while θ moves.

    For P1 = p + c, P1(φᵀθ) = θᵀ(P1 φ) + φᵀθ', and θ' = Γ φ ef is known. Then ef = G φᵀ(θ⁰ − θ)
    and V = xᵀPx + (θ⁰ − θ)ᵀΓ⁻¹(θ⁰ − θ) never grows without disturbance.

    Raises ParameterError for deg P1 > 1, which would need derivatives of ef.
    """

    model: ErrorModel
    """G, P1, P2 and θ⁰."""

    def __post_init__(self) -> None:
        _require_positive_gain(self.model)
        if self.model.P1.degree() > 1:
            raise ParameterError(
                "degree of P1",
                self.model.P1.degree(),
                "must be at most 1: beyond, the control would need derivatives of the error; "
                "use an augmented error",
            )

    @property
    def strictly_positive_real(self) -> tuple[fmpq_poly, fmpq_poly]:
        """Numerator and denominator of the transfer function that has to be SPR: G."""
        return self.model.transfer

    @property
    def equations(self) -> tuple[str, ...]:
        """What runs, in LaTeX."""
        compensation = r" - (\varphi^T\Gamma\varphi)\,e_f" if self.model.needs_augmentation else ""
        return (
            r"u = -\theta^T (P_1\varphi)" + compensation,
            r"\dot\theta = \Gamma\varphi\,e_f",
        )

    def _repr_latex_(self) -> str:
        return _aligned(self.equations)


AdaptationScheme = AugmentedError | AugmentedErrorUnknownGain | DirectError


def _require_positive_gain(model: ErrorModel) -> None:
    if not model.b0 > 0:
        raise ParameterError("gain b0", model.b0, "must be positive; change the sign of u")


def _aligned(equations: tuple[str, ...]) -> str:
    rows = " \\\\ ".join(equation.replace("=", "&=", 1) for equation in equations)
    return f"$\\begin{{aligned}}{rows}\\end{{aligned}}$"
