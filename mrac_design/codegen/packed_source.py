"""Packed programs as C functions of numbers, with vectors inside."""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from mrac_design.codegen.c_source import c_function_text, literal, operation_text
from mrac_design.codegen.packing import PackedLine
from mrac_design.codegen.straight_line import CONSTANT, FMA, FMS, FNMA, GATHER, INPUT, LANE, LOAD

PACKS = """\
#if defined(__AVX2__)
#include <immintrin.h>
#endif
typedef double pack __attribute__((vector_size(4 * sizeof(double))));
typedef long long pack_bits __attribute__((vector_size(4 * sizeof(double))));
typedef double pack_in_row __attribute__((vector_size(4 * sizeof(double)), aligned(8), may_alias));
static inline pack pack_abs(pack a) { return (pack)((pack_bits)a & 0x7fffffffffffffffLL); }
#if defined(__AVX2__) && defined(__FMA__)
static inline pack pack_fma(pack a, pack b, pack c) {
    return (pack)_mm256_fmadd_pd((__m256d)a, (__m256d)b, (__m256d)c);
}
static inline pack pack_fms(pack a, pack b, pack c) {
    return (pack)_mm256_fmsub_pd((__m256d)a, (__m256d)b, (__m256d)c);
}
static inline pack pack_fnma(pack a, pack b, pack c) {
    return (pack)_mm256_fnmadd_pd((__m256d)a, (__m256d)b, (__m256d)c);
}
#else
static inline pack pack_fma(pack a, pack b, pack c) {
    pack r;
    for (int l = 0; l < 4; ++l) r[l] = real_fma(a[l], b[l], c[l]);
    return r;
}
static inline pack pack_fms(pack a, pack b, pack c) { return pack_fma(a, b, -c); }
static inline pack pack_fnma(pack a, pack b, pack c) { return pack_fma(-a, b, c); }
#endif
"""
"""Definitions that `packed_routine` needs besides those of `support(1)`."""
_OPERATORS = {
    FMA: "pack_fma({0}, {1}, {2})",
    FMS: "pack_fms({0}, {1}, {2})",
    FNMA: "pack_fnma({0}, {1}, {2})",
    ca.OP_FABS: "pack_abs({0})",
}


def packed_routine(program: PackedLine, name: str) -> str:
    """A static C function: a pointer for each input, then for each output, in program's order."""
    names = [argument for argument, _ in program.inputs]
    return c_function_text(name, names, program.outputs, _statements(program, names))


def _statements(program: PackedLine, names: Sequence[str]) -> list[str]:
    lines: list[str] = []
    shown: list[str] = []
    for i, (operation, arguments, value, wide) in enumerate(program.nodes):
        if operation == INPUT:
            shown.append(f"{names[arguments[0]]}[{arguments[1]}]")
        elif operation == LOAD:
            shown.append(f"*(const pack_in_row *)({names[arguments[0]]} + {arguments[1]})")
        elif operation == CONSTANT:
            shown.append(f"({literal(value)})")
        else:
            operands = [shown[j] for j in arguments]
            if operation == GATHER:
                text = f"{{{', '.join(operands)}}}"
            elif operation == LANE:
                text = f"{operands[0]}[{int(value)}]"
            elif not wide:
                text = operation_text(operation, operands)
            else:
                if operation in _OPERATORS:
                    operands = [
                        q if program.nodes[j].wide else f"(pack){{{q}, {q}, {q}, {q}}}"
                        for q, j in zip(operands, arguments, strict=True)
                    ]
                text = _OPERATORS.get(operation, "").format(*operands) or operation_text(
                    operation, operands
                )
            lines.append(f"const {'pack' if wide else 'double'} w{i} = {text};")
            shown.append(f"w{i}")
    for name, entries in program.outputs:
        lines += [f"{name}[{k}] = {shown[i]};" for k, i in enumerate(entries)]
    return lines
