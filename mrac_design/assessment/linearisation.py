"""A simulated axis loop as matrices: CasADi's derivatives of the very functions that run.

Between two sampling instants the plant flows, at an instant the memory is renewed and the plant
goes on with the new command. With x the plant's state and z the memory before the instant k,

    z⁺ = U_x x + U_z z        x⁺ = F x + G z⁺,     (F, G) = exp of the plant's rate over one period
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from scipy.linalg import expm

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.simulation.single_axis import AxisLoop, resting_axis
from mrac_design.stability import AdaptiveLoop, Sampling, StabilityCertificate
from mrac_design.stability.certificate import vertices_of
from mrac_design.stability.exact_matrix import to_floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearisedAxis:
    """A loop linearised at rest under a constant force, adaptation included."""

    matrix: FloatArray
    """State matrix, (n, n): of the rate (1/s), or from one sampling instant to the next."""
    names: tuple[str, ...]
    """Name of every entry of the state."""
    period: float | None
    """Sampling period (s), None in continuous time."""

    @property
    def adapting(self) -> FloatArray:
        """Eigenvalues without those of gains that do not move, (m,) complex.

        At rest only the combination of gains along the regressor adapts; the others stay.
        """
        gains = np.array(["gains" in name for name in self.names])
        still = 0.0 if self.period is None else 1.0
        moving = self.matrix[gains] - still * np.eye(len(gains))[gains]
        left, size, _ = np.linalg.svd(moving)
        basis = np.eye(len(gains))[:, ~gains]
        if size[0] > 0:
            direction = np.zeros((len(gains), 1))
            direction[gains, 0] = left[:, 0]
            basis = np.hstack([basis, direction])
        return np.asarray(np.linalg.eigvals(basis.T @ self.matrix @ basis))

    @property
    def growth(self) -> float:
        """Fastest growth of any mode (1/s); negative when all die out."""
        eigenvalues = self.adapting
        if self.period is None:
            return float(eigenvalues.real.max())
        return float(np.log(max(np.abs(eigenvalues).max(), 1e-300)) / self.period)


def linearise_axis(
    loop: AxisLoop,
    *,
    force: float,
    gains: FloatArray | None = None,
    parameters: FloatArray | None = None,
) -> LinearisedAxis:
    """The loop about rest at a constant `force` (N); `gains` replaces its scaled gains.

    `parameters` replaces the loop's own (same layout). Raises ParameterError when `gains` does
    not fit the controller.
    """
    system = loop.system
    p = loop.parameter_values if parameters is None else parameters
    x, z = (np.array(part) for part in resting_axis(loop, force=force, heart=0.0))
    sampled = system.update is not None
    layout, vector = (system.held, z) if sampled else (system.state, x)
    place = layout.slices["controller"].start + loop.step.state.slices["gains"].start
    count = loop.step.state.slices["gains"].stop - loop.step.state.slices["gains"].start
    if gains is not None:
        if len(gains) != count:
            raise ParameterError("gains", len(gains), f"needs the controller's {count} gains")
        vector[place : place + count] = gains
    v = system.inputs.pack({name: 0.0 for name, _ in system.inputs.blocks} | {"reference": force})
    rate_x, rate_z = _derivatives(system.rate, x, z, v, p)
    names = list(system.state.entry_names)
    names[:] = _marked(names, place, count) if not sampled else names
    if system.update is None or system.sampling_period is None:
        return LinearisedAxis(matrix=readonly(rate_x), names=tuple(names), period=None)
    held = _marked(list(system.held.entry_names), place, count)
    update_x, update_z = _derivatives(system.update, x, z, v, p)
    n, m = len(x), len(z)
    block = np.zeros((n + m, n + m))
    block[:n, :n], block[:n, n:] = rate_x, rate_z
    flow = expm(block * system.sampling_period)
    F, G = flow[:n, :n], flow[:n, n:]
    matrix = np.block([[F + G @ update_x, G @ update_z], [update_x, update_z]])
    return LinearisedAxis(
        matrix=readonly(matrix), names=(*names, *held), period=system.sampling_period
    )


def certificate_gap(certificate: StabilityCertificate, loop: AxisLoop) -> float:
    """How far the certificate's matrices are from those of the code that runs.

    Largest entry of S M − A S over the corners of the box, relative to the largest entry of A:
    M is the linearised loop with its gains and stiffness at the corner, A the certificate's matrix
    there and S the scaling of the state. `loop` has the certificate's timing; its adaptation may
    be anything, for no gain moves at zero force. The gains' own columns are left out: they are the
    path, and a bias among them acts as a disturbance.
    """
    worst = 0.0
    ends = zip(certificate.box.corners(), _vertex_matrices(certificate), strict=False)
    for corner, A in ends:
        values = np.array([int(v.p) / int(v.q) for v in corner])
        parts = loop.system.parameters.split(np.array(loop.parameter_values))
        stiffness = values[-1] * _float(certificate.loop.design_stiffness)
        p = loop.system.parameters.pack({**parts, "stiffness": stiffness})
        count = loop.step.state.slices["gains"].stop - loop.step.state.slices["gains"].start
        gains = np.zeros(count)
        gains[: len(values) - 1] = values[:-1]
        found = linearise_axis(loop, force=0.0, gains=readonly(gains), parameters=p)
        S = _scaling(certificate, found.names, loop.step.state)
        unit = 1.0 if found.period else 1 / _float(certificate.loop.bandwidth)
        gap = unit * S @ found.matrix - A @ S
        # Columns that the certificate's state does not contain must not act on it at all.
        own = np.array(["gains" not in name for name in found.names])
        relative = (np.abs(gap) / _column_sizes(S))[:, own]
        worst = max(worst, float(relative.max() / np.abs(A).max()))
    return worst


@lru_cache(maxsize=8)
def _jacobians(function: ca.Function) -> ca.Function:
    """Derivatives of a function to its first two arguments; kept, for a scan asks many times."""
    arguments = [function.sx_in(i) for i in range(4)]
    result = function(*arguments)
    jacobians = [ca.densify(ca.jacobian(result, arguments[i])) for i in (0, 1)]
    return ca.Function("derivatives", arguments, jacobians)


def _derivatives(
    function: ca.Function, x: FloatArray, z: FloatArray, v: FloatArray, p: FloatArray
) -> tuple[FloatArray, FloatArray]:
    first, second = _jacobians(function)(x, z, v, p)
    return first.full(), second.full()


def _marked(names: list[str], place: int, count: int) -> list[str]:
    """Entry names with those of the gains recognisable."""
    return [f"gains: {n}" if place <= i < place + count else n for i, n in enumerate(names)]


def _vertex_matrices(certificate: StabilityCertificate) -> list[FloatArray]:
    vertices = vertices_of(certificate.loop, certificate.box, certificate.timing)
    return [to_floats(vertex.A) for vertex in vertices]


def _scaling(
    certificate: StabilityCertificate, names: tuple[str, ...], controller: Layout
) -> FloatArray:
    """S with (ŷ, Ẑ, x̂u, x̂y, û_{k−1}, …) = S · (state of the linearised loop)."""
    axis: AdaptiveLoop = certificate.loop
    b0, omega = _float(axis.design_stiffness), _float(axis.bandwidth)
    delay = certificate.timing.delay if isinstance(certificate.timing, Sampling) else 0
    first = names.index("controller[0]")
    powers = [
        (chain, k, unit * omega ** (k + 1))
        for chain, unit in (("filtered_command", b0 / omega**2), ("filtered_force", 1.0))
        for k in range(axis.degree)
    ]
    wanted = [
        ("position", b0),
        ("velocity", b0 / omega),
        *((names[first + controller.slices[chain].start + k], unit) for chain, k, unit in powers),
        *((f"pipeline[{k}]" if delay else "pipeline", b0 / omega**2) for k in range(delay)),
    ]
    S = np.zeros((len(wanted), len(names)))
    for row, (name, scale) in enumerate(wanted):
        S[row, names.index(name)] = scale
    return S


def _column_sizes(S: FloatArray) -> FloatArray:
    sizes = np.abs(S).max(axis=0)
    return np.where(sizes > 0, sizes, np.abs(S).max())


def _float(value: object) -> float:
    return int(value.p) / int(value.q)  # type: ignore[attr-defined]
