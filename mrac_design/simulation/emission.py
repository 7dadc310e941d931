"""From CasADi SX functions to straight-line C."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

_BINARY = {
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_FMIN: "fmin({0}, {1})",
    ca.OP_FMAX: "fmax({0}, {1})",
    ca.OP_LT: "(double)({0} < {1})",
    ca.OP_LE: "(double)({0} <= {1})",
    ca.OP_EQ: "(double)({0} == {1})",
    ca.OP_NE: "(double)({0} != {1})",
    ca.OP_AND: "(double)({0} != 0.0 && {1} != 0.0)",
    ca.OP_OR: "(double)({0} != 0.0 || {1} != 0.0)",
    ca.OP_IF_ELSE_ZERO: "({0} != 0.0 ? {1} : 0.0)",
    ca.OP_POW: "pow({0}, {1})",
    ca.OP_CONSTPOW: "pow({0}, {1})",
    ca.OP_ATAN2: "atan2({0}, {1})",
    ca.OP_COPYSIGN: "copysign({0}, {1})",
}
_UNARY = {
    ca.OP_ASSIGN: "{0}",
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "1.0 / {0}",
    ca.OP_SQRT: "sqrt({0})",
    ca.OP_SIN: "sin({0})",
    ca.OP_COS: "cos({0})",
    ca.OP_TAN: "tan({0})",
    ca.OP_ATAN: "atan({0})",
    ca.OP_TANH: "tanh({0})",
    ca.OP_EXP: "exp({0})",
    ca.OP_LOG: "log({0})",
    ca.OP_FABS: "fabs({0})",
    ca.OP_FLOOR: "floor({0})",
    ca.OP_SIGN: "(double)(({0} > 0.0) - ({0} < 0.0))",
    ca.OP_NOT: "(double)({0} == 0.0)",
}


def simplified(function: ca.Function) -> ca.Function:
    """The same SX function with common subexpressions shared."""
    arguments = function.sx_in()
    outputs = ca.cse(list(function.call(arguments)))
    return ca.Function(function.name(), arguments, outputs, function.name_in(), function.name_out())


def c_function(function: ca.Function, name: str, *, inputs: Sequence[str], output: str) -> str:
    """A static C function of dense double arrays computing the only output of `function`.

    The operations and their order are CasADi's own, so both give the same bits as long as the
    compiler neither contracts nor reorders floating-point expressions.
    """
    body = "\n".join(f"    {line}" for line in _statements(function, inputs, output))
    arguments = ", ".join(f"const double *restrict {argument}" for argument in inputs)
    unused = " ".join(f"(void){argument};" for argument in inputs)
    return (
        f"static void {name}({arguments}, double *restrict {output})\n"
        f"{{\n    {unused}\n{body}\n}}\n"
    )


def _statements(function: ca.Function, inputs: Sequence[str], output: str) -> list[str]:
    assert function.n_out() == 1
    rows = [function.sparsity_in(i).row() for i in range(function.n_in())]
    output_rows = function.sparsity_out(0).row()
    lines = [
        f"{output}[{i}] = 0.0;"
        for i in sorted(set(range(function.numel_out(0))) - set(output_rows))
    ]
    declared: set[int] = set()
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            lines.append(f"{output}[{output_rows[target[1]]}] = w{source[0]};")
            continue
        if operation == ca.OP_INPUT:
            value = f"{inputs[source[0]]}[{rows[source[0]][source[1]]}]"
        elif operation == ca.OP_CONST:
            value = _literal(function.instruction_constant(k))
        else:
            template = _UNARY.get(operation) or _BINARY[operation]
            value = template.format(*(f"w{i}" for i in source))
        kind = "" if target[0] in declared else "double "
        declared.add(target[0])
        lines.append(f"{kind}w{target[0]} = {value};")
    return lines


def _literal(value: float) -> str:
    text = repr(float(value))
    if text in ("inf", "-inf"):
        return text.replace("inf", "INFINITY")
    return text if any(mark in text for mark in ".e") else f"{text}.0"
