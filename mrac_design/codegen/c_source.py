"""Straight-line programs as C functions of numbers, or of lanes of numbers.

The text works on a type `real`: a double, or a vector of doubles (an extension of gcc and clang)
of which every lane goes the same way. `support` defines the type and what C has no operator for.
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from mrac_design.codegen.straight_line import CONSTANT, FMA, FMS, FNMA, INPUT, StraightLine

OPERATORS = {
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_NEG: "-{0}",
    ca.OP_FMIN: "real_min({0}, {1})",
    ca.OP_FMAX: "real_max({0}, {1})",
    ca.OP_LT: "real_where({0} < {1})",
    ca.OP_LE: "real_where({0} <= {1})",
    ca.OP_EQ: "real_where({0} == {1})",
    ca.OP_NE: "real_where({0} != {1})",
    ca.OP_AND: "real_where(({0} != 0.0) & ({1} != 0.0))",
    ca.OP_OR: "real_where(({0} != 0.0) | ({1} != 0.0))",
    ca.OP_NOT: "real_where({0} == 0.0)",
    ca.OP_IF_ELSE_ZERO: "real_if({0} != 0.0, {1})",
    ca.OP_SIGN: "real_where({0} > 0.0) - real_where({0} < 0.0)",
    ca.OP_FABS: "real_abs({0})",
    FMA: "real_fma({0}, {1}, {2})",
    FMS: "real_fms({0}, {1}, {2})",
    FNMA: "real_fnma({0}, {1}, {2})",
}
_MIX = (ca.OP_ADD, ca.OP_SUB, ca.OP_MUL, ca.OP_DIV, ca.OP_NEG)
"""Operators that take a vector and a number."""
FUNCTIONS = {
    ca.OP_SQRT: "sqrt", ca.OP_SIN: "sin", ca.OP_COS: "cos", ca.OP_TAN: "tan",
    ca.OP_ASIN: "asin", ca.OP_ACOS: "acos", ca.OP_ATAN: "atan", ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh", ca.OP_TANH: "tanh", ca.OP_EXP: "exp", ca.OP_LOG: "log",
    ca.OP_FLOOR: "floor", ca.OP_CEIL: "ceil", ca.OP_EXPM1: "expm1", ca.OP_LOG1P: "log1p",
    ca.OP_POW: "pow", ca.OP_ATAN2: "atan2", ca.OP_HYPOT: "hypot", ca.OP_FMOD: "fmod",
    ca.OP_COPYSIGN: "copysign",
}  # fmt: skip
"""Operations left to the C mathematics library, by its names."""

_SCALAR = """\
typedef double real;
#define splat(x) (x)
#define real_where(condition) ((double)(condition))
#define real_if(condition, a) ((condition) ? (a) : 0.0)
#define real_any(condition) (condition)
#define real_abs(a) __builtin_fabs(a)
#define real_call1(function, a) function(a)
#define real_call2(function, a, b) function(a, b)
#if defined(__FMA__) || defined(__ARM_FEATURE_FMA)
static inline double real_fma(double a, double b, double c) { return __builtin_fma(a, b, c); }
#else
static inline double real_fma(double a, double b, double c) { return a * b + c; }
#endif
static inline double real_fms(double a, double b, double c) { return real_fma(a, b, -c); }
static inline double real_fnma(double a, double b, double c) { return real_fma(-a, b, c); }
static inline double real_min(double a, double b) { return a < b ? a : b; }
static inline double real_max(double a, double b) { return a > b ? a : b; }
"""
_VECTOR = """\
#if defined(__AVX2__)
#include <immintrin.h>
#endif
typedef double real __attribute__((vector_size(LANES * sizeof(double))));
typedef long long mask __attribute__((vector_size(LANES * sizeof(double))));
#define splat(x) ((real){0.0} + (x))
static inline real real_where(mask c) { return (real)(c & (mask)splat(1.0)); }
static inline real real_if(mask c, real a) { return (real)(c & (mask)a); }
static inline real real_abs(real a) { return (real)((mask)a & 0x7fffffffffffffffLL); }
static inline real real_min(real a, real b) {
    const mask c = a < b;
    return (real)((c & (mask)a) | (~c & (mask)b));
}
static inline real real_max(real a, real b) {
    const mask c = a > b;
    return (real)((c & (mask)a) | (~c & (mask)b));
}
#if defined(__AVX512F__)
static inline real real_fma(real a, real b, real c) {
    return (real)_mm512_fmadd_pd((__m512d)a, (__m512d)b, (__m512d)c);
}
static inline real real_fms(real a, real b, real c) {
    return (real)_mm512_fmsub_pd((__m512d)a, (__m512d)b, (__m512d)c);
}
static inline real real_fnma(real a, real b, real c) {
    return (real)_mm512_fnmadd_pd((__m512d)a, (__m512d)b, (__m512d)c);
}
#elif defined(__AVX2__) && defined(__FMA__)
static inline real real_fma(real a, real b, real c) {
    union { real all; __m256d half[2]; } x = { a }, y = { b }, z = { c };
    z.half[0] = _mm256_fmadd_pd(x.half[0], y.half[0], z.half[0]);
    z.half[1] = _mm256_fmadd_pd(x.half[1], y.half[1], z.half[1]);
    return z.all;
}
#elif defined(__ARM_FEATURE_FMA)
static inline real real_fma(real a, real b, real c) {
    real r;
    for (int l = 0; l < LANES; ++l) r[l] = __builtin_fma(a[l], b[l], c[l]);
    return r;
}
#else
static inline real real_fma(real a, real b, real c) { return a * b + c; }
#endif
#if !defined(__AVX512F__)
static inline real real_fms(real a, real b, real c) { return real_fma(a, b, -c); }
static inline real real_fnma(real a, real b, real c) { return real_fma(-a, b, c); }
#endif
static inline int real_any(mask c) {
    long long any = 0;
    for (int l = 0; l < LANES; ++l) any |= c[l];
    return any != 0;
}
static inline real real_call1(double (*function)(double), real a) {
    real r;
    for (int l = 0; l < LANES; ++l) r[l] = function(a[l]);
    return r;
}
static inline real real_call2(double (*function)(double, double), real a, real b) {
    real r;
    for (int l = 0; l < LANES; ++l) r[l] = function(a[l], b[l]);
    return r;
}
"""


def support(lanes: int) -> str:
    """Definitions the functions need, for one number (`lanes` 1) or eight at once (8)."""
    assert lanes in (1, 8)
    return f"enum {{ LANES = {lanes} }};\n" + (_SCALAR if lanes == 1 else _VECTOR)


def c_routine(program: StraightLine, name: str, *, inputs: Sequence[str] | None = None) -> str:
    """A static C function: a pointer for each input, then for each output, in program's order.

    `inputs` names those to keep, where the others are not used.
    """
    kept = [n for n, _ in program.inputs] if inputs is None else inputs
    return c_function_text(name, kept, program.outputs, _statements(program))


def c_function_text(
    name: str,
    inputs: Sequence[str],
    outputs: Sequence[tuple[str, tuple[int, ...]]],
    statements: Sequence[str],
) -> str:
    """A static function on `real` of those statements."""
    pointers = [
        *(f"const real *restrict {argument}" for argument in inputs),
        *(f"real *restrict {result}" for result, _ in outputs),
    ]
    unused = " ".join(f"(void){n};" for n in (*inputs, *(n for n, _ in outputs)))
    body = "\n".join(f"    {line}" for line in statements)
    return f"static void {name}({', '.join(pointers)})\n{{\n    {unused}\n{body}\n}}\n"


def operation_text(operation: int, operands: Sequence[str]) -> str:
    """The C expression of an operation."""
    if operation in FUNCTIONS:
        return f"real_call{len(operands)}({FUNCTIONS[operation]}, {', '.join(operands)})"
    return OPERATORS[operation].format(*operands)


def literal(value: float) -> str:
    """A C constant of exactly this value."""
    text = repr(float(value))
    if text in ("inf", "-inf"):
        return text.replace("inf", "INFINITY")
    return text if any(mark in text for mark in ".en") else f"{text}.0"


def _statements(program: StraightLine) -> list[str]:
    lines = []
    shown: list[str] = []
    for i, (operation, arguments, value) in enumerate(program.nodes):
        if operation == INPUT:
            shown.append(f"{program.inputs[arguments[0]][0]}[{arguments[1]}]")
            continue
        if operation == CONSTANT:
            text = literal(value)
            shown.append(f"({text})" if value < 0 else text)
            continue
        operands = [shown[j] for j in arguments]
        if operation not in _MIX:
            operands = [
                f"splat({operand})" if program.nodes[j].operation == CONSTANT else operand
                for operand, j in zip(operands, arguments, strict=True)
            ]
        lines.append(f"const real w{i} = {operation_text(operation, operands)};")
        shown.append(f"w{i}")
    for name, entries in program.outputs:
        lines += [
            f"{name}[{k}] = splat({shown[i]});"
            if program.nodes[i].operation == CONSTANT
            else f"{name}[{k}] = {shown[i]};"
            for k, i in enumerate(entries)
        ]
    return lines
