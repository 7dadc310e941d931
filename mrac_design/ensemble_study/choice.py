"""How many runs an ensemble takes, and how far they lie apart."""

from __future__ import annotations

from dataclasses import dataclass

from mrac_design.errors import ParameterError
from mrac_design.study import VARIANTS, Variant


@dataclass(frozen=True, slots=True, kw_only=True)
class EnsembleChoice:
    """How many runs, and how far they lie apart."""

    runs: int = 1000
    """Number of runs."""
    seed: int = 0
    """Seed of all draws."""
    stiffness_range: tuple[float, float] | None = None
    """True Ks (N/m), drawn evenly; None is 0.6 to 1.5 times the scenario's."""
    gain_range: tuple[float, float] | None = None
    """Scaled γ̂, drawn evenly in its logarithm; None is half to twice the scenario's, and no
    draw where nothing adapts."""
    inertia_spread: float = 0.05
    """Each body of the true robot is scaled by a factor within 1 ± this, drawn evenly."""
    motion_seeds: int | None = None
    """How many motions of other beat-to-beat variation (and sensor noise) to pick from; None is
    32, or 1 for a recording."""
    variant: str = "adaptive_inverse"
    """Name of the controller."""
    step: float | None = None
    """Integration step (s) of the Runge–Kutta method of order 4; None is a quarter of the time
    constant of the fastest designed pole, at most 0.5 ms."""

    @property
    def controller(self) -> Variant:
        """The controller of that name."""
        return next(variant for variant in VARIANTS if variant.name == self.variant)

    def __post_init__(self) -> None:
        names = [variant.name for variant in VARIANTS]
        if self.variant not in names:
            raise ParameterError("variant", self.variant, f"must be one of {', '.join(names)}")
        if self.runs < 1:
            raise ParameterError("runs", self.runs, "must be at least 1")
        if self.seed < 0:
            raise ParameterError("seed", self.seed, "must be 0 or more")
        for name in ("stiffness_range", "gain_range"):
            limits = getattr(self, name)
            if limits is not None and not 0 < limits[0] <= limits[1] < float("inf"):
                raise ParameterError(name.replace("_", " "), limits, "needs 0 < low <= high")
        if not 0 <= self.inertia_spread < 1:
            raise ParameterError("inertia spread", self.inertia_spread, "must lie in [0, 1)")
        if self.motion_seeds is not None and self.motion_seeds < 1:
            raise ParameterError("motion seeds", self.motion_seeds, "must be at least 1")
        if self.step is not None and not 0 < self.step < float("inf"):
            raise ParameterError("step", self.step, "must be a finite time > 0 s")
