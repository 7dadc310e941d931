"""CasADi SX functions as straight-line C on named variables, in `double` or `float`.

Every intermediate value gets a constant of its own and results are stored last, so a result may
lie where an argument was read from. The operations and their order are CasADi's: in `double`,
without contraction, the bits are those of CasADi's own machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

# Comparing selects compile to minimum and maximum instructions and, unlike fmin and fmax, let
# a NaN in the first operand through: a limit must not turn a broken sensor into full torque.
_BINARY = {
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_FMIN: "({1} < {0}) ? {1} : {0}",
    ca.OP_FMAX: "({1} > {0}) ? {1} : {0}",
    ca.OP_LT: "({0} < {1}) ? 1.0{s} : 0.0{s}",
    ca.OP_LE: "({0} <= {1}) ? 1.0{s} : 0.0{s}",
    ca.OP_EQ: "({0} == {1}) ? 1.0{s} : 0.0{s}",
    ca.OP_NE: "({0} != {1}) ? 1.0{s} : 0.0{s}",
    ca.OP_AND: "({0} != 0.0{s} && {1} != 0.0{s}) ? 1.0{s} : 0.0{s}",
    ca.OP_OR: "({0} != 0.0{s} || {1} != 0.0{s}) ? 1.0{s} : 0.0{s}",
    ca.OP_IF_ELSE_ZERO: "({0} != 0.0{s}) ? {1} : 0.0{s}",
    ca.OP_POW: "pow{s}({0}, {1})",
    ca.OP_CONSTPOW: "pow{s}({0}, {1})",
    ca.OP_ATAN2: "atan2{s}({0}, {1})",
    ca.OP_COPYSIGN: "copysign{s}({0}, {1})",
}
_UNARY = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "1.0{s} / {0}",
    ca.OP_SQRT: "sqrt{s}({0})",
    ca.OP_SIN: "sin{s}({0})",
    ca.OP_COS: "cos{s}({0})",
    ca.OP_TAN: "tan{s}({0})",
    ca.OP_ATAN: "atan{s}({0})",
    ca.OP_TANH: "tanh{s}({0})",
    ca.OP_EXP: "exp{s}({0})",
    ca.OP_LOG: "log{s}({0})",
    ca.OP_FABS: "fabs{s}({0})",
    ca.OP_FLOOR: "floor{s}({0})",
    ca.OP_SIGN: "({0} > 0.0{s}) ? 1.0{s} : (({0} < 0.0{s}) ? -1.0{s} : 0.0{s})",
    ca.OP_NOT: "({0} == 0.0{s}) ? 1.0{s} : 0.0{s}",
}
_NO_OPERATION = (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_ASSIGN)


@dataclass(frozen=True, slots=True, kw_only=True)
class RealType:
    """A floating-point type of C."""

    name: str
    """Its name in C."""
    suffix: str
    """Suffix of its literals and of the mathematical functions that work in it."""
    dtype: np.dtype[np.floating]
    """The same type in NumPy."""

    def literal(self, value: float) -> str:
        """Shortest text that C reads back as `value` rounded to this type."""
        with np.errstate(over="ignore"):
            number = self.dtype.type(value)
        if not np.isfinite(number):
            return "NAN" if np.isnan(number) else ("INFINITY" if number > 0 else "-INFINITY")
        text = np.format_float_scientific(number, trim="-", exp_digits=1)
        mantissa, exponent = text.split("e")
        if -5 < int(exponent) < 7:
            text = np.format_float_positional(number, trim="0")
        elif "." not in mantissa:
            text = f"{mantissa}.0e{exponent}"
        return text + self.suffix


DOUBLE = RealType(name="double", suffix="", dtype=np.dtype(np.float64))
"""64 bits: the same bits as the simulation."""

FLOAT = RealType(name="float", suffix="f", dtype=np.dtype(np.float32))
"""32 bits: for processors whose floating-point unit knows nothing else."""

REAL_TYPES = {number.name: number for number in (DOUBLE, FLOAT)}
"""Both by name."""


def c_statements(
    function: ca.Function,
    *,
    inputs: Sequence[Sequence[str]],
    outputs: Sequence[Sequence[str]],
    real: str,
    number: RealType,
) -> list[str]:
    """C statements computing every output of `function`, one a line.

    `inputs` and `outputs` name an lvalue per entry of each dense argument and result; `real` is
    the name of the type the statements declare, an alias of `number`.
    """
    read = [function.sparsity_in(i).row() for i in range(function.n_in())]
    written = [function.sparsity_out(i).row() for i in range(function.n_out())]
    lines: list[str] = []
    results = {
        (i, j): number.literal(0.0) for i, own in enumerate(outputs) for j in range(len(own))
    }
    names: dict[int, str] = {}
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            results[target[0], written[target[0]][target[1]]] = names[source[0]]
            continue
        if operation == ca.OP_CONST:
            # A constant needs no variable; parentheses keep a sign apart from an operator.
            text = number.literal(function.instruction_constant(k))
            names[target[0]] = f"({text})" if text.startswith("-") else text
            continue
        if operation == ca.OP_INPUT:
            value = inputs[source[0]][read[source[0]][source[1]]]
        else:
            template = _UNARY.get(operation) or _BINARY[operation]
            value = template.format(*(names[i] for i in source), s=number.suffix)
        names[target[0]] = f"t{k}"
        lines.append(f"const {real} t{k} = {value};")
    lines += [f"{outputs[i][j]} = {text};" for (i, j), text in results.items()]
    return lines


def operation_count(function: ca.Function) -> int:
    """Arithmetic operations, comparisons and mathematical functions of an SX function."""
    return sum(
        function.instruction_id(k) not in _NO_OPERATION for k in range(function.n_instructions())
    )
