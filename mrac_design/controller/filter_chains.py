r"""The filters of the adaptive RST controller: a signal through 1/Ao, and on through 1/Am.

    v ─► 1/Ao ─┬─► pⁱ v/Ao,  i = n − 1 … 0
               └─► 1/Am ─► p v/(Ao Am),  v/(Ao Am)

One chain of n + 2 states serves all powers: pⁿ v/Ao follows from v itself, pⁱ v/(Ao Am) for
i ≥ 2 from Am z = v/Ao. No derivative of v is ever taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.design import RSTSpecification


def chain_equations(specification: RSTSpecification) -> tuple[FloatArray, FloatArray]:
    """(A, B) of x' = A x + B v, x = (p^{n-1} v/Ao, …, v/Ao, p z, z), Am z = v/Ao."""
    n = specification.degree
    damping, stiffness = specification.reference_model.polynomial[1:]
    A = np.eye(n + 2, k=-1)
    A[0, :n] = -np.array(specification.observer[1:])
    A[n, n:] = -damping, -stiffness
    B = np.zeros((n + 2, 1))
    B[0, 0] = 1.0
    return A, B


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilterChain:
    """Filtered powers of one signal; polynomials in p act on them from the highest power down."""

    states: ca.SX
    """(p^{n-1} v/Ao, …, v/Ao, p z, z), (n + 2,)."""
    observer: ca.SX
    """α1 … αn of Ao, (n,)."""
    model: ca.SX
    """2ξω and ω² of Am, (2,)."""

    @property
    def degree(self) -> int:
        """n, the degree of Ao."""
        return int(self.observer.numel())

    def before_model(self, signal: ca.SX) -> ca.SX:
        """pⁱ v/Ao for i = n … 0, `signal` being v, (n + 1,)."""
        inner = self.states[: self.degree]
        return ca.vertcat(signal - ca.dot(self.observer, inner), inner)

    def after_model(self) -> ca.SX:
        """pⁱ v/(Ao Am) for i = n … 0, (n + 1,)."""
        n = self.degree
        powers = [self.states[n + 1], self.states[n]]
        for i in range(2, n + 1):
            known = self.model[0] * powers[i - 1] + self.model[1] * powers[i - 2]
            powers.append(self.states[n + 1 - i] - known)
        return ca.vertcat(*reversed(powers))


def settled(observer: ca.SX, model: ca.SX, value: ca.SX) -> ca.SX:
    """States of a chain that has settled on a constant `value`, (n + 2,); `observer` and `model`
    as in `FilterChain`."""
    n = int(observer.numel())
    level = value / observer[n - 1]
    return ca.vertcat(ca.SX.zeros(n - 1), level, 0, level / model[1])
