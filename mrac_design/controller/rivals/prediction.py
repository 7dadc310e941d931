"""Prediction with an ARIMAX model and the receding-horizon law it leads to.

    A(q⁻¹) y(k) = B(q⁻¹) u(k − 1 − d) + C(q⁻¹) ξ(k) / Δ(q⁻¹)

Δ names the disturbances the model expects: 1 − q⁻¹ steps, (1 − q⁻¹)(1 − q⁻ᵀ) anything of period
T. The future is predicted by running A Δ y = B Δu + C ξ forward, with ξ the past prediction
errors and no future ones. Minimising Σ (ŷ − r)² + λ Σ (Δu)² over the horizon then gives

    Δu = (GᵀG + λ I)⁻¹ Gᵀ (r − f)

with f the free response and G the step response (Clarke, Mohtadi, Tuffs 1987).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError


@dataclass(frozen=True, slots=True, kw_only=True)
class Horizon:
    """Over which future the cost is counted."""

    first: int
    """N1: first predicted sample that counts, at least 1 + dead time."""
    last: int
    """N2: last predicted sample that counts."""
    moves: int
    """Nu: number of command increments that are free, the later ones being zero."""
    penalty: float
    """λ: cost of a squared increment ((N/(m/s²))²), ≥ 0."""

    def __post_init__(self) -> None:
        if not 1 <= self.first <= self.last:
            raise ParameterError("horizon", (self.first, self.last), "needs 1 <= N1 <= N2")
        if not 1 <= self.moves <= self.last:
            raise ParameterError("moves Nu", self.moves, "must be from 1 to N2")
        if not 0 <= self.penalty < float("inf"):
            raise ParameterError("penalty λ", self.penalty, "must be finite and >= 0")


def horizon_gains(step_response: FloatArray, horizon: Horizon) -> FloatArray:
    """First row of (GᵀG + λI)⁻¹Gᵀ, weights of r − f at samples N1 … N2, (N2 − N1 + 1,).

    `step_response` (N2 + 1,) starts at sample 0. Raises ParameterError when the increments do
    not determine a unique minimum.
    """
    rows = np.arange(horizon.first, horizon.last + 1)[:, None]
    lags = rows - np.arange(horizon.moves)[None, :]
    G = np.where(lags >= 0, step_response[np.clip(lags, 0, None)], 0.0)
    # Stacking sqrt(λ) I keeps the problem's own conditioning, which GᵀG would square.
    stacked = np.vstack([G, np.sqrt(horizon.penalty) * np.eye(horizon.moves)])
    if np.linalg.matrix_rank(stacked) < horizon.moves:
        raise ParameterError(
            "horizon", horizon, "leaves increments free: start it after the dead time or use λ > 0"
        )
    targets = np.vstack([np.eye(rows.size), np.zeros((horizon.moves, rows.size))])
    return readonly(np.linalg.lstsq(stacked, targets, rcond=None)[0][0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArimaxModel:
    """Polynomials in q⁻¹, ascending powers, A, C and Δ monic."""

    A: FloatArray
    """Denominator of the process."""
    B: FloatArray
    """Numerator of the process, after one sample and the dead time."""
    C: FloatArray
    """Noise polynomial; its roots are the observer's poles."""
    difference: FloatArray
    """Δ."""
    delay: int
    """Dead time d in whole samples."""

    @property
    def output_memory(self) -> int:
        """Number of past outputs a prediction needs."""
        return int(self.A.size + self.difference.size - 2)

    @property
    def input_memory(self) -> int:
        """Number of past inputs a prediction needs."""
        return int(self.B.size + self.delay + self.difference.size - 1)

    @property
    def error_memory(self) -> int:
        """Number of past prediction errors a prediction needs."""
        return int(self.C.size - 1)

    def step_response(self, count: int) -> FloatArray:
        """Output at samples 0 … count after a unit increment of the input, (count + 1,)."""
        a = np.convolve(self.A, [1.0, -1.0])
        response = np.zeros(count + 1)
        for k in range(count + 1):
            lag = k - 1 - self.delay
            past = sum(a[i] * response[k - i] for i in range(1, min(a.size, k + 1)))
            response[k] = (self.B[lag] if 0 <= lag < self.B.size else 0.0) - past
        return readonly(response)

    def prediction_error(
        self, output: FloatArray, outputs: FloatArray, inputs: FloatArray, errors: FloatArray
    ) -> FloatArray:
        """Row of ξ(k) = y(k) − ŷ(k|k−1), from the rows of the present and past signals.

        `outputs`, `inputs` and `errors` hold past samples, newest first.
        """
        ad = np.convolve(self.A, self.difference)
        bd = np.convolve(self.B, self.difference)
        at = 0 + self.delay  # y(k) answers to u(k − 1 − d), which is inputs[d]
        expected = -ad[1:] @ outputs[: ad.size - 1] + bd @ inputs[at : at + bd.size]
        error: FloatArray = output - expected - self.C[1:] @ errors[: self.C.size - 1]
        return error

    def free_response(
        self, outputs: FloatArray, inputs: FloatArray, errors: FloatArray, count: int
    ) -> FloatArray:
        """Rows of ŷ(k + 1 … k + count) if Δu stays zero from k on, (count, columns).

        All arguments newest first; `outputs` and `errors` begin at k, `inputs` at k − 1.
        """
        ad = np.convolve(self.A, self.difference)
        history = list(outputs[: ad.size - 1])
        increments = self._increments(inputs)
        none = np.zeros_like(increments[0])
        predictions = []
        for j in range(1, count + 1):
            row = -sum(ad[i] * history[i - 1] for i in range(1, ad.size) if ad[i] != 0.0)
            for i, b in enumerate(self.B):
                lag = self.delay + i - j  # Δu(k + j − 1 − d − i) is increments[lag]
                row = row + b * (increments[lag] if 0 <= lag < len(increments) else none)
            for i in range(j, self.C.size):
                row = row + self.C[i] * errors[i - j]
            history = [row, *history[:-1]]
            predictions.append(row)
        return np.array(predictions)

    def held_input(self, inputs: FloatArray) -> FloatArray:
        """Row of the input at k that makes Δu(k) zero, from past ones newest first."""
        row: FloatArray = -self.difference[1:] @ inputs[: self.difference.size - 1]
        return row

    def _increments(self, inputs: FloatArray) -> list[FloatArray]:
        """Rows of Δu(k − 1), Δu(k − 2), …: as many as predictions need."""
        taps = self.difference
        used = np.flatnonzero(taps)
        return [
            np.asarray(sum(taps[i] * inputs[lag + i] for i in used))
            for lag in range(self.B.size + self.delay - 1)
        ]
