"""The C program that runs a hybrid system under an integration method."""

from __future__ import annotations

import casadi as ca
import numpy as np

from mrac_design.codegen.c_source import c_routine, support
from mrac_design.simulation.emission import c_function, simplified
from mrac_design.simulation.method import Method
from mrac_design.simulation.stepping import ARGUMENTS, Prepared, finished, prepare, step_program
from mrac_design.simulation.system import HybridSystem
from mrac_design.simulation.tableau import ButcherTableau

_TEMPLATE = """\
#include <math.h>
#include <stddef.h>
#include <string.h>
#if defined(__SSE2__)
#include <xmmintrin.h>
#endif

{support}
enum {{
    NX = {states}, NZ = {held}, NV = {inputs}, NY = {outputs}, NP = {parameters},
    POWERS = {powers}, PREPARED = {prepared}, READY = {ready}, STAGES = {stages},
    /* Whole vectors of numbers, so that the compiler needs no loop for the rest. */
    WIDTH = LANES > 1 ? NX : (NX + 7) / 8 * 8
}};

{functions}
/* Value of the inputs at time s after the beginning of their segment. */
static inline void inputs_at(const real *restrict segment, real s, real *restrict v)
{{
    for (int i = 0; i < NV; ++i) {{
        const real *c = segment + (size_t)i * POWERS;
        real value = c[POWERS - 1];
        for (int k = POWERS - 2; k >= 0; --k) value = value * s + c[k];
        v[i] = value;
    }}
}}

/* The memory's change, number by number: the very function that goes to the robot. */
static void sample(const real *x, real *z, const real *v, const real *p)
{{
    double own_x[NX + 1], own_z[NZ + 1], own_v[NV + 1], own_p[NP + 1], next[NZ + 1];
    for (int l = 0; l < LANES; ++l) {{
        for (int i = 0; i < NX; ++i) own_x[i] = ((const double *)(x + i))[l];
        for (int i = 0; i < NZ; ++i) own_z[i] = ((const double *)(z + i))[l];
        for (int i = 0; i < NV; ++i) own_v[i] = ((const double *)(v + i))[l];
        for (int i = 0; i < NP; ++i) own_p[i] = ((const double *)(p + i))[l];
        update(own_x, own_z, own_v, own_p, next);
        for (int i = 0; i < NZ; ++i) ((double *)(z + i))[l] = next[i];
    }}
}}

{step}
/* Denormal numbers make decaying states forty times slower and mean nothing: they are zero
   inside a run. Returns the state to restore. */
static unsigned flush_denormals(void)
{{
#if defined(__SSE2__)
    const unsigned before = _mm_getcsr();
    _mm_setcsr(before | 0x8040u);
    return before;
#else
    return 0;
#endif
}}

static void restore_denormals(unsigned before)
{{
#if defined(__SSE2__)
    _mm_setcsr(before);
#else
    (void)before;
#endif
}}

/* Runs n intervals; returns how many of them began with a record. */
long run(long n, const double *start, const double *length, const long long *substeps,
         const long long *segment, const double *offset, const unsigned char *records,
         const unsigned char *updates, const real *coefficients, const real *p, real *state,
         real *z, real *recorded)
{{
    const unsigned before = flush_denormals();
    real v[NV + 1], prepared[PREPARED + 1], ready[READY + 1];
    real x[WIDTH + 1], y[WIDTH + 1], k[STAGES][WIDTH + 1], base[WIDTH + 1];
    double since = 0.0, last = 1.0;
    memset(base, 0, sizeof base);
    memset(x, 0, sizeof x);
    memset(k, 0, sizeof k);
    memcpy(x, state, NX * sizeof *x);
    long rows = 0;
    rate_setup(p, prepared);
    record_setup(p, ready);
    for (long i = 0; i < n; ++i) {{
        const real *c = coefficients + (size_t)segment[i] * NV * POWERS;
        const real *at = x;
        if (substeps[i] == 0) {{
            /* Inside the step before: the method tells the solution there. */
            between(base, k, last, (offset[i] - since) / last, y);
            at = y;
        }}
        if (records[i] || updates[i]) inputs_at(c, splat(offset[i]), v);
        if (updates[i]) sample(x, z, v, p);
        if (records[i]) {{
            {record}
            ++rows;
        }}
        if (substeps[i] == 0) continue;
        const double h = length[i] / (double)substeps[i];
        const int spans = i + 1 < n && substeps[i + 1] == 0;
        if (spans) {{
            memcpy(base, x, sizeof base);
            since = offset[i];
            last = h;
        }}
        for (long long j = 0; j < substeps[i]; ++j)
            step(x, z, c, p, prepared, offset[i] + (double)j * h, h, k, y);
        if (spans) extend(base, x, z, c, p, prepared, since, h, k, y);
    }}
    memcpy(state, x, NX * sizeof *x);
    restore_denormals(before);
    return rows;
}}
"""

_RUNGE_KUTTA = """\
/* One step of the {name} method from time s within the segment. */
static void step(real *restrict x, const real *restrict z, const real *restrict segment,
                 const real *restrict p, const real *restrict prepared, double s, double h,
                 real (*restrict k)[WIDTH + 1], real *restrict y)
{{
    real v[NV + 1];
{code}
}}
"""

_EXTENSION = """\
/* Further evaluations of the step from `base` to `x` that tell the solution between them. */
static void extend(const real *restrict base, const real *restrict x, const real *restrict z,
                   const real *restrict segment, const real *restrict p,
                   const real *restrict prepared, double s, double h,
                   real (*restrict k)[WIDTH + 1], real *restrict y)
{{
    real v[NV + 1];
{code}
}}

/* The state after the share `theta` of the step of length h from `base`. */
static void between(const real *restrict base, real (*restrict k)[WIDTH + 1], double h,
                    double theta, real *restrict y)
{{
{weights}
    for (int i = 0; i < WIDTH; ++i) y[i] = base[i] + h * ({sum});
}}
"""

_NO_EXTENSION = """\
#define extend(base, x, z, c, p, prepared, since, h, k, y) (void)0
#define between(base, k, h, theta, y) (void)0
"""

_SERIES = """\
/* From time s within the segment over h, in as many steps of the {name} as its error asks for. */
static void step(real *restrict x, const real *restrict z, const real *restrict segment,
                 const real *restrict p, const real *restrict prepared, double s, double h,
                 real (*restrict k)[WIDTH + 1], real *restrict y)
{{
    (void)k;
    real *following = y, used, time = splat(s), rest = splat(h);
    do {{
        advance(x, z, segment, &time, &rest, p, prepared, following, &used);
        memcpy(x, following, NX * sizeof *x);
        time = time + used;
        rest = rest - used;
    }} while (real_any(rest > 0.0));
}}
"""

_RECORD = "output(at, z, v, p, ready, recorded + (size_t)NY * rows);"
_REDUCE = """const real now = splat(start[i]);
            real next[NY + 1];
            fold(at, z, v, p, recorded, &now, ready, next);
            memcpy(recorded, next, NY * sizeof *next);"""


def c_program(
    system: HybridSystem,
    method: Method,
    *,
    input_powers: int,
    lanes: int = 1,
    reduction: ca.Function | None = None,
) -> str:
    """Source with one exported function, `run`, for `lanes` runs in lockstep.

    `input_powers` is the inputs' degree + 1. Records the system's outputs, or, given a
    `reduction` (state, held, input, parameters, accumulators, time) → accumulators, folds it over
    the recording instants. Arrays of one run are (...,), of several (..., lanes).
    """
    rate = prepare(system.rate)
    step, routines = _step(system, rate, method, input_powers)
    if reduction is None:
        record, size = prepare(system.output), system.outputs.size
    else:
        record = prepare(reduction, names=(*ARGUMENTS, "accumulators", "now"))
        size = reduction.numel_out(0)
    routines += [
        c_routine(rate.setup, "rate_setup", inputs=["p"]),
        c_routine(record.setup, "record_setup", inputs=["p"]),
        c_routine(finished(record.body), "output" if reduction is None else "fold"),
        _update(system),
    ]
    return _TEMPLATE.format(
        support=support(lanes),
        states=system.state.size,
        stages=_evaluations(method),
        held=system.held.size,
        inputs=system.inputs.size,
        outputs=size,
        parameters=system.parameters.size,
        powers=input_powers,
        prepared=len(rate.setup.output("prepared")),
        ready=len(record.setup.output("prepared")),
        functions="\n".join(routines),
        step=step,
        record=_RECORD if reduction is None else _REDUCE,
    )


def _step(
    system: HybridSystem, rate: Prepared, method: Method, powers: int
) -> tuple[str, list[str]]:
    if isinstance(method, ButcherTableau):
        code = "\n".join(_stage_lines(method))
        step = _RUNGE_KUTTA.format(name=method.name, code=code) + _extension(method)
        return step, [c_routine(finished(rate.body), "rate")]
    advance = step_program(system, rate, method, powers)
    step = _SERIES.format(name=method.name) + _NO_EXTENSION
    return step, [c_routine(advance, "advance")]


def _evaluations(method: Method) -> int:
    """Slopes kept of a step."""
    if not isinstance(method, ButcherTableau):
        return 1
    return method.stages if method.extension is None else method.extension.weights.shape[0]


def _extension(method: ButcherTableau) -> str:
    extension = method.extension
    if extension is None:
        return _NO_EXTENSION
    first = method.stages
    lines = [
        "    inputs_at(segment, splat(s + h), v);",
        f"    rate(x, z, v, p, prepared, k[{first}]);",
    ]
    for number, (row, fraction) in enumerate(zip(extension.a, extension.c, strict=True)):
        value = _combination(row).replace("x[i]", "base[i]")
        lines += [
            f"    for (int i = 0; i < WIDTH; ++i) y[i] = {value};",
            f"    inputs_at(segment, splat(s + {float(fraction)!r} * h), v);",
            f"    rate(y, z, v, p, prepared, k[{first + 1 + number}]);",
        ]
    weights, terms = [], []
    for number, row in enumerate(extension.weights):
        if not row.any():
            continue
        value = repr(float(row[-1]))
        for weight in row[-2::-1]:
            value = f"({value} * theta + {float(weight)!r})"
        weights.append(f"    const double b{number} = {value} * theta;")
        terms.append(f"b{number} * k[{number}][i]")
    return _EXTENSION.format(
        code="\n".join(lines), weights="\n".join(weights), sum=" + ".join(terms)
    )


def _update(system: HybridSystem) -> str:
    if system.update is not None:
        return c_function(simplified(system.update), "update", inputs=ARGUMENTS, output="next")
    arguments = ", ".join(f"const double *restrict {name}" for name in ARGUMENTS)
    unused = " ".join(f"(void){name};" for name in (*ARGUMENTS, "next"))
    return f"static void update({arguments}, double *restrict next)\n{{\n    {unused}\n}}\n"


def _stage_lines(method: ButcherTableau) -> list[str]:
    lines = []
    for stage in range(method.stages):
        if stage:
            lines.append(
                f"    for (int i = 0; i < WIDTH; ++i) y[i] = {_combination(method.a[stage])};"
            )
        # A stage at the same instant as the one before sees the same input.
        if stage == 0 or method.c[stage] != method.c[stage - 1]:
            time = f"s + {float(method.c[stage])!r} * h"
            lines.append(f"    inputs_at(segment, splat({time}), v);")
        lines.append(f"    rate({'y' if stage else 'x'}, z, v, p, prepared, k[{stage}]);")
    lines.append(f"    for (int i = 0; i < WIDTH; ++i) x[i] = {_combination(method.b)};")
    return lines


def _combination(weights: np.ndarray) -> str:
    terms = [f"{float(w)!r} * k[{i}][i]" for i, w in enumerate(weights) if w != 0]
    return f"x[i] + h * ({' + '.join(terms)})"
