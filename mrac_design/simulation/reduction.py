"""Figures of merit gathered while a run goes on, so that nothing of it need be kept."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray, readonly
from mrac_design.layout import Layout
from mrac_design.simulation.system import ARGUMENT_NAMES, HybridSystem


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reduction:
    """A fold over the recording instants, and what it comes to in the end.

    a⁺ = fold(a, output, time)      at every recording instant
    metrics = finish(a)             at the end
    """

    initial: FloatArray
    """Accumulators before the first record, shape (k,)."""
    fold: ca.Function
    """SX function (accumulators (k,), output (outputs.size,), time s) → following (k,)."""
    finish: ca.Function
    """SX function (accumulators (k,)) → metrics (len(metrics),)."""
    metrics: tuple[str, ...]
    """Name of every metric."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "initial", readonly(self.initial, (-1,)))
        assert self.fold.numel_out(0) == self.initial.size
        assert self.finish.numel_out(0) == len(self.metrics)

    def over(self, system: HybridSystem) -> ca.Function:
        """The fold of a system's own variables: outputs nobody asks for are not computed."""
        arguments = system.arguments()
        sums, now = ca.SX.sym("accumulators", self.initial.size), ca.SX.sym("now")
        following = self.fold(sums, system.output(*arguments), now)
        names = [*ARGUMENT_NAMES, "accumulators", "now"]
        return ca.Function("fold", [*arguments, sums, now], [following], names, ["following"])

    def finished(self, sums: ArrayLike) -> FloatArray:
        """Metrics (runs, len(metrics)) of accumulators (runs, k)."""
        rows = np.atleast_2d(np.asarray(sums, dtype=float))
        result: FloatArray = self.finish.map(rows.shape[0])(rows.T).full().T
        return result


def tracking_reduction(outputs: Layout, *, settling: float) -> Reduction:
    """Largest and rms force errors per axis after `settling` s, and largest efforts, of a force
    loop with these outputs.

    Metrics: `max_force_error[i]` and `rms_force_error[i]` of |force − desired force|,
    `max_model_error[i]` of |force − model force| (N), `max_effort[j]` (N·m or N).
    """
    signals = outputs.split(outputs.symbols("output"))
    axes, efforts = signals["force"].numel(), signals["effort"].numel()
    sums = Layout(
        (
            ("max_force_error", axes),
            ("square_sum", axes),
            ("count", 1),
            ("max_model_error", axes),
            ("max_effort", efforts),
        )
    )
    metrics = Layout(
        (
            ("max_force_error", axes),
            ("rms_force_error", axes),
            ("max_model_error", axes),
            ("max_effort", efforts),
        )
    )
    return Reduction(
        initial=np.zeros(sums.size),
        fold=_tracking_fold(sums, outputs, settling),
        finish=_tracking_finish(sums, metrics),
        metrics=metrics.entry_names,
    )


def _tracking_fold(sums: Layout, outputs: Layout, settling: float) -> ca.Function:
    a, y, now = sums.symbols("accumulators"), outputs.symbols("output"), ca.SX.sym("time")
    before, signals = sums.split(a), outputs.split(y)
    error = signals["force"] - signals["desired_force"]
    model_error = signals["force"] - signals["model_force"]
    counts = now >= settling
    following = sums.join(
        {
            "max_force_error": ca.fmax(before["max_force_error"], counts * ca.fabs(error)),
            "square_sum": before["square_sum"] + counts * error**2,
            "count": before["count"] + counts,
            "max_model_error": ca.fmax(before["max_model_error"], counts * ca.fabs(model_error)),
            "max_effort": ca.fmax(before["max_effort"], ca.fabs(signals["effort"])),
        }
    )
    return ca.Function("fold", [a, y, now], [following])


def _tracking_finish(sums: Layout, metrics: Layout) -> ca.Function:
    a = sums.symbols("accumulators")
    total = sums.split(a)
    mean_square = total["square_sum"] / ca.fmax(total["count"], 1)
    largest = {name: total[name] for name in ("max_force_error", "max_model_error", "max_effort")}
    return ca.Function(
        "finish", [a], [metrics.join({**largest, "rms_force_error": ca.sqrt(mean_square)})]
    )
