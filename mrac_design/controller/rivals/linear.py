"""Linear controllers as rows of numbers, and the `ControllerStep` they stand for.

Every signal of a linear controller is a row of coefficients over the columns

    [state …, force y, reference r, applied command u]

so laws are written with NumPy's own algebra on rows, one small formula at a time:

    columns = Columns(Layout((("estimate", 3), ("prefilter", 2))))
    innovation = columns.force - C @ columns.block("estimate")
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import casadi as ca
import control
import numpy as np
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.assembly import StepSymbols, assemble_step
from mrac_design.controller.step import ControllerStep
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.time_domain import TimeDomain

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Columns:
    """The columns that rows are written over: a controller's state and its three inputs."""

    state: Layout
    """Entries of the state."""

    @property
    def size(self) -> int:
        """Number of columns."""
        return self.state.size + 3

    def block(self, name: str) -> FloatArray:
        """Rows of the state's block `name`, shape (its length, size)."""
        part = self.state.slices[name]
        rows = np.zeros((part.stop - part.start, self.size))
        rows[:, part] = np.eye(part.stop - part.start)
        return rows

    @property
    def force(self) -> FloatArray:
        """Row of the measured force, (size,)."""
        return self._unit(-3)

    @property
    def reference(self) -> FloatArray:
        """Row of the force reference, (size,)."""
        return self._unit(-2)

    @property
    def applied(self) -> FloatArray:
        """Row of the applied command, (size,)."""
        return self._unit(-1)

    def _unit(self, index: int) -> FloatArray:
        row = np.zeros(self.size)
        row[index] = 1.0
        return row


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearController:
    """A linear controller of one axis, complete."""

    time_domain: TimeDomain
    """What advancing means: a derivative, or the value a period later."""
    columns: Columns
    """State and inputs the rows are written over."""
    following: Mapping[str, FloatArray]
    """How each block of the state advances, rows (its length, columns.size)."""
    registers: Mapping[str, FloatArray] = field(default_factory=dict)
    """Shift registers: blocks whose first entry becomes this row and whose others move on by one.

    Together with `following` they cover the state.
    """
    command: FloatArray
    """Row of the command (m/s²); it cannot depend on the applied command."""
    signals: Mapping[str, FloatArray]
    """Rows of what is reported."""
    rest: Mapping[str, FloatArray | float]
    """State at rest under a force and reference of 1 N, by block."""

    def __post_init__(self) -> None:
        names = {name for name, _ in self.columns.state.blocks}
        assert set(self.following) | set(self.registers) == names, "every block must advance"
        assert self.command[-1] == 0.0, "a command cannot depend on itself"
        rows = [self.command, *self.signals.values(), *self.following.values()]
        if not all(np.isfinite(row).all() for row in [*rows, *self.registers.values()]):
            raise ParameterError("controller", "NaN or inf", "its coefficients must be finite")

    def matrices(self) -> tuple[FloatArray, FloatArray]:
        """Rows of the whole advanced state (n, n + 3) and of the command (n + 3,)."""
        columns = self.columns
        rows = np.zeros((columns.state.size, columns.size))
        for name, part in columns.state.slices.items():
            if name in self.following:
                rows[part] = self.following[name]
            else:
                rows[part.start] = self.registers[name]
                rows[np.arange(part.start + 1, part.stop), np.arange(part.start, part.stop - 1)] = 1
        return readonly(rows), readonly(self.command)

    def feedback(self) -> control.StateSpace:
        """From the measured force to the command, with every command applied as computed."""
        rows, command = self.matrices()
        n = self.columns.state.size
        closed = rows[:, : n + 2] + np.outer(rows[:, -1], command[: n + 2])
        return control.StateSpace(
            closed[:, :n], closed[:, [n]], command[None, :n], command[[n]], dt=self.time_domain.dt
        )


def build_linear_step(controller: LinearController) -> ControllerStep:
    """The controller as CasADi functions; its coefficients other than 0 and 1 are parameters."""
    columns = controller.columns
    layout = columns.state
    table = [
        *((f"next_{name}", rows) for name, rows in controller.following.items()),
        *((f"next_{name}", row) for name, row in controller.registers.items()),
        ("command", controller.command),
        *((f"signal_{name}", rows) for name, rows in controller.signals.items()),
    ]
    tables = {name: np.atleast_2d(rows) for name, rows in table}
    free = {name: _free_entries(rows) for name, rows in tables.items()}
    rest = layout.pack(controller.rest)
    parameters = Layout((*((name, len(at[0])) for name, at in free.items()), ("rest", layout.size)))
    symbols = StepSymbols.of(layout, parameters)
    state, numbers = layout.split(symbols.state), parameters.split(symbols.parameters)
    vector = ca.vertcat(symbols.state, symbols.force, symbols.reference, symbols.applied)
    results = {
        name: _combination(rows, free[name], numbers[name], vector) for name, rows in tables.items()
    }
    following = {name: results[f"next_{name}"] for name in controller.following} | {
        name: ca.vertcat(results[f"next_{name}"], *ca.vertsplit(state[name])[:-1])
        for name in controller.registers
    }
    return assemble_step(
        symbols,
        time_domain=controller.time_domain,
        values=parameters.pack(
            {**{name: tables[name][at] for name, at in free.items()}, "rest": rest}
        ),
        command=results["command"],
        following=following,
        signals={name: results[f"signal_{name}"] for name in controller.signals},
        rest=symbols.force * numbers["rest"],
    )


def _free_entries(rows: FloatArray) -> tuple[Indices, Indices]:
    """Where the coefficients are that are neither 0 nor 1."""
    i, j = np.nonzero((rows != 0.0) & (rows != 1.0))
    return i, j


def _combination(
    rows: FloatArray, free: tuple[Indices, Indices], values: ca.SX, vector: ca.SX
) -> ca.SX:
    """rows @ vector, with the free entries as symbols."""
    results = [ca.SX(0)] * rows.shape[0]
    for i, j in zip(*np.nonzero(rows == 1.0), strict=True):
        results[i] = results[i] + vector[int(j)]
    for k, (i, j) in enumerate(zip(*free, strict=True)):
        results[i] = results[i] + values[k] * vector[int(j)]
    return ca.vertcat(*results)
