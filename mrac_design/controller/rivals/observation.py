"""Sampled plant, disturbance chain and Kalman filter: what observers and predictors share.

The state of the plant is x = (y, ẏ): contact force and its rate. Through

    ÿ = Ks (u + p) − K2 ẏ,    p = −(Ẍh + K2 Ẋh)

the heart's motion acts like a command p (m/s²), whatever the motion is.
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.advance import linear_advance
from mrac_design.controller.rivals.linear import Columns
from mrac_design.errors import ParameterError
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Discrete


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledModel:
    """x⁺ = Φ x + Γ u, y = C x, the command acting `delay` samples after it is computed."""

    transition: FloatArray
    """Φ, (n, n)."""
    input: FloatArray
    """Γ, (n,)."""
    output: FloatArray
    """C, (n,)."""
    delay: int
    """Dead time in whole samples."""

    @property
    def order(self) -> int:
        """Number of states n, the dead time not counted."""
        return int(self.input.size)

    def with_disturbance(self, transition: FloatArray, output: FloatArray) -> SampledModel:
        """The model with a disturbance p = `output` · w, w⁺ = `transition` w, at its input."""
        n, m = self.order, output.size
        augmented = np.zeros((n + m, n + m))
        augmented[:n, :n] = self.transition
        augmented[:n, n:] = np.outer(self.input, output)
        augmented[n:, n:] = transition
        return SampledModel(
            transition=readonly(augmented),
            input=readonly(np.concatenate([self.input, np.zeros(m)])),
            output=readonly(np.concatenate([self.output, np.zeros(m)])),
            delay=self.delay,
        )


def sampled_plant(plant: ForcePlant, domain: Discrete, *, delay: int) -> SampledModel:
    """The force plant with its command held over each period, x = (y, ẏ)."""
    if int(delay) != delay or delay < 0:
        raise ParameterError("delay", delay, "must be a whole number of samples >= 0")
    A = np.array([[0.0, 1.0], [0.0, -plant.velocity_gain]])
    transition, input_ = linear_advance(domain, A, np.array([[0.0], [plant.b0]]))
    return SampledModel(
        transition=transition,
        input=readonly(input_[:, 0]),
        output=readonly([1.0, 0.0]),
        delay=int(delay),
    )


def difference_chain(order: int) -> tuple[FloatArray, FloatArray]:
    """(transition, output) of a disturbance whose `order`-th difference is white."""
    if int(order) != order or order < 1:
        raise ParameterError("observer order", order, "must be a whole number >= 1")
    transition = np.eye(order) + np.diag(np.ones(order - 1), 1)
    return readonly(transition), readonly(np.eye(order)[0])


def kalman_gain(model: SampledModel, drive: FloatArray, force_noise: float) -> FloatArray:
    """Steady gain K of x̂(k|k) = x̂(k|k−1) + K (y − C x̂(k|k−1)), (n,).

    `drive` (n, m) brings m unit white noises into the state, `force_noise` (N) is the standard
    deviation of the sensor's. Raises ParameterError when that noise is not positive.
    """
    if not 0 < force_noise < float("inf"):
        raise ParameterError("force noise", force_noise, "must be a positive force in N")
    C = model.output[None, :]
    noises = np.eye(drive.shape[1])
    _, P, _ = control.dlqe(model.transition, drive, C, noises, np.array([[force_noise**2]]))
    return readonly((P @ C.T / (C @ P @ C.T + force_noise**2))[:, 0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ObserverRows:
    """A Kalman filter in the columns of a controller, with the commands still on their way."""

    filtered: FloatArray
    """x̂(k|k), (n, columns)."""
    ahead: FloatArray
    """x̂(k + delay|k): the state the next command will meet, (n, columns)."""
    following: FloatArray
    """x̂(k + 1|k), (n, columns)."""


def observer_rows(
    columns: Columns,
    model: SampledModel,
    gain: FloatArray,
    *,
    estimate: str,
    pending: str,
    command: FloatArray,
) -> ObserverRows:
    """The filter whose prediction is the block `estimate` and whose dead time is `pending`.

    `pending` is a shift register of length delay, newest first, fed by the row `command`; without
    dead time `command` acts at once.
    """
    predicted = columns.block(estimate)
    filtered = predicted + np.outer(gain, columns.force - model.output @ predicted)
    waiting = columns.block(pending) if model.delay else np.empty((0, columns.size))
    acting = waiting[-1] if model.delay else command
    following = model.transition @ filtered + np.outer(model.input, acting)
    ahead = filtered
    for oldest in waiting[::-1]:
        ahead = model.transition @ ahead + np.outer(model.input, oldest)
    return ObserverRows(filtered=filtered, ahead=ahead, following=following)


def pending_block(name: str, delay: int) -> tuple[tuple[str, int], ...]:
    """The state's block for commands on their way; none without dead time."""
    return ((name, delay),) if delay else ()
