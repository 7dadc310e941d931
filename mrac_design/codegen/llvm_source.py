"""Straight-line programs as functions of LLVM's assembly language."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import casadi as ca

from mrac_design.codegen.c_source import FUNCTIONS
from mrac_design.codegen.straight_line import CONSTANT, FMA, FMS, FNMA, INPUT, StraightLine

_ARITHMETIC = {ca.OP_ADD: "fadd", ca.OP_SUB: "fsub", ca.OP_MUL: "fmul", ca.OP_DIV: "fdiv"}
_COMPARISONS = {ca.OP_LT: "olt", ca.OP_LE: "ole", ca.OP_EQ: "oeq", ca.OP_NE: "une"}


def declarations() -> str:
    """Functions that programs call: LLVM's own, and those of the C mathematics library."""
    lines = [
        "declare double @llvm.fma.f64(double, double, double)",
        "declare double @llvm.fabs.f64(double)",
        "declare double @llvm.sqrt.f64(double)",
    ]
    for operation, name in FUNCTIONS.items():
        count = 2 if operation in _TWO_ARGUMENTS else 1
        if operation != ca.OP_SQRT:
            lines.append(f"declare double @{name}({', '.join(['double'] * count)})")
    return "\n".join(lines)


def llvm_routine(program: StraightLine, name: str, *, inputs: Sequence[str] | None = None) -> str:
    """An internal function: a pointer for each of the `inputs` (all of them), then the outputs."""
    kept = [n for n, _ in program.inputs] if inputs is None else inputs
    names = [*kept, *(f"out_{n}" for n, _ in program.outputs)]
    arguments = ", ".join(f"ptr noalias %{n}" for n in names)
    body = "\n".join(f"  {line}" for line in _Writer(program).lines())
    return f"define internal void @{name}({arguments}) {{\n{body}\n  ret void\n}}\n"


def literal(value: float) -> str:
    """An LLVM constant of exactly this value."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


_TWO_ARGUMENTS = (ca.OP_POW, ca.OP_ATAN2, ca.OP_HYPOT, ca.OP_FMOD, ca.OP_COPYSIGN)


class _Writer:
    """Writes one program; every value has the name of its position."""

    def __init__(self, program: StraightLine) -> None:
        self._program = program
        self._lines: list[str] = []
        self._shown: list[str] = []
        self._count = 0

    def lines(self) -> list[str]:
        for operation, arguments, value in self._program.nodes:
            if operation == INPUT:
                pointer = self._let(
                    f"getelementptr double, ptr %{self._program.inputs[arguments[0]][0]}, "
                    f"i64 {arguments[1]}"
                )
                self._shown.append(self._let(f"load double, ptr {pointer}"))
            elif operation == CONSTANT:
                self._shown.append(literal(value))
            else:
                operands = [self._shown[j] for j in arguments]
                self._shown.append(self._operation(operation, operands))
        for name, entries in self._program.outputs:
            for k, i in enumerate(entries):
                pointer = self._let(f"getelementptr double, ptr %out_{name}, i64 {k}")
                self._lines.append(f"store double {self._shown[i]}, ptr {pointer}")
        return self._lines

    def _let(self, text: str) -> str:
        self._count += 1
        self._lines.append(f"%w{self._count} = {text}")
        return f"%w{self._count}"

    def _call(self, name: str, operands: Sequence[str]) -> str:
        return self._let(f"call double @{name}({', '.join(f'double {a}' for a in operands)})")

    def _negative(self, a: str) -> str:
        return self._let(f"fneg double {a}")

    def _true(self, condition: str) -> str:
        return self._let(f"uitofp i1 {condition} to double")

    def _compare(self, kind: str, a: str, b: str) -> str:
        return self._let(f"fcmp {kind} double {a}, {b}")

    def _select(self, condition: str, a: str, b: str) -> str:
        return self._let(f"select i1 {condition}, double {a}, double {b}")

    def _operation(self, operation: int, q: list[str]) -> str:
        zero = literal(0.0)
        if operation in _ARITHMETIC:
            return self._let(f"{_ARITHMETIC[operation]} double {q[0]}, {q[1]}")
        if operation == ca.OP_NEG:
            return self._negative(q[0])
        if operation == FMA:
            return self._call("llvm.fma.f64", q)
        if operation == FMS:
            return self._call("llvm.fma.f64", [q[0], q[1], self._negative(q[2])])
        if operation == FNMA:
            return self._call("llvm.fma.f64", [self._negative(q[0]), q[1], q[2]])
        if operation in _COMPARISONS:
            return self._true(self._compare(_COMPARISONS[operation], *q))
        if operation in (ca.OP_FMIN, ca.OP_FMAX):
            kind = "olt" if operation == ca.OP_FMIN else "ogt"
            return self._select(self._compare(kind, *q), *q)
        if operation == ca.OP_IF_ELSE_ZERO:
            return self._select(self._compare("une", q[0], zero), q[1], zero)
        if operation in (ca.OP_AND, ca.OP_OR):
            one, other = (self._compare("une", a, zero) for a in q)
            word = "and" if operation == ca.OP_AND else "or"
            return self._true(self._let(f"{word} i1 {one}, {other}"))
        if operation == ca.OP_NOT:
            return self._true(self._compare("oeq", q[0], zero))
        if operation == ca.OP_SIGN:
            up, down = (self._true(self._compare(kind, q[0], zero)) for kind in ("ogt", "olt"))
            return self._let(f"fsub double {up}, {down}")
        if operation == ca.OP_FABS:
            return self._call("llvm.fabs.f64", q)
        if operation == ca.OP_SQRT:
            return self._call("llvm.sqrt.f64", q)
        return self._call(FUNCTIONS[operation], q)
