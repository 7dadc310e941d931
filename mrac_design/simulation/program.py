"""The C program that runs a hybrid system under an integration method."""

from __future__ import annotations

import casadi as ca

from mrac_design.codegen.c_source import c_routine, support
from mrac_design.simulation.emission import c_function, simplified
from mrac_design.simulation.located_program import ProgramParts, located_parts
from mrac_design.simulation.method import Method
from mrac_design.simulation.runge_kutta_text import (
    evaluations,
    extension_text,
    stage_lines,
)
from mrac_design.simulation.side_by_side import rate_text
from mrac_design.simulation.stepping import ARGUMENTS, finished, prepare
from mrac_design.simulation.system import HybridSystem

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
   inside a run, on x86 and 64-bit Arm. Returns the state to restore. */
static unsigned long flush_denormals(void)
{{
#if defined(__SSE2__)
    const unsigned before = _mm_getcsr();
    _mm_setcsr(before | 0x8040u);
    return before;
#elif defined(__aarch64__) && defined(__GNUC__)
    unsigned long before;
    __asm__ volatile("mrs %0, fpcr" : "=r"(before));
    __asm__ volatile("msr fpcr, %0" : : "r"(before | 1ul << 24));
    return before;
#else
    return 0;
#endif
}}

static void restore_denormals(unsigned long before)
{{
#if defined(__SSE2__)
    _mm_setcsr((unsigned)before);
#elif defined(__aarch64__) && defined(__GNUC__)
    __asm__ volatile("msr fpcr, %0" : : "r"(before));
#else
    (void)before;
#endif
}}

{run}"""

_RUN = """\
/* Runs n intervals; returns how many of them began with a record. */
long run(long n, const double *start, const double *length, const long long *substeps,
         const long long *segment, const double *offset, const unsigned char *records,
         const unsigned char *updates, const real *coefficients, const real *p, real *state,
         real *z, real *recorded)
{
    const unsigned long before = flush_denormals();
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
    for (long i = 0; i < n; ++i) {
        const real *c = coefficients + (size_t)segment[i] * NV * POWERS;
        const real *at = x;
        if (substeps[i] == 0) {
            /* Inside the step before: the method tells the solution there. */
            between(base, k, last, (offset[i] - since) / last, y);
            at = y;
        }
        if (records[i] || updates[i]) inputs_at(c, splat(offset[i]), v);
        if (updates[i]) sample(x, z, v, p);
        if (records[i]) {
            {record}
            ++rows;
        }
        if (substeps[i] == 0) continue;
        const double h = length[i] / (double)substeps[i];
        const int spans = i + 1 < n && substeps[i + 1] == 0;
        if (spans) {
            memcpy(base, x, sizeof base);
            since = offset[i];
            last = h;
        }
        for (long long j = 0; j < substeps[i]; ++j)
            step(x, z, c, p, prepared, offset[i] + (double)j * h, h, k, y);
        if (spans) extend(base, x, z, c, p, prepared, since, h, k, y);
    }
    memcpy(state, x, NX * sizeof *x);
    restore_denormals(before);
    return rows;
}
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
    the recording instants. Arrays of one run are (...,), of several (..., lanes). With events, a
    program that records has one more argument, the log of `located_program`.
    """
    if reduction is None:
        record, size = prepare(system.output), system.outputs.size
    else:
        record = prepare(reduction, names=(*ARGUMENTS, "accumulators", "now"))
        size = reduction.numel_out(0)
    parts = (
        located_parts(system, method, lanes=lanes, logs=reduction is None and lanes == 1)
        if system.events
        else _plain_parts(system, method, lanes)
    )
    routines = [
        *parts.routines,
        c_routine(parts.setup, "rate_setup", inputs=["p"]),
        c_routine(record.setup, "record_setup", inputs=["p"]),
        c_routine(finished(record.body), "output" if reduction is None else "fold"),
        _update(system),
    ]
    return _TEMPLATE.format(
        support=support(lanes),
        states=system.state.size,
        stages=evaluations(method),
        held=system.held.size,
        inputs=system.inputs.size,
        outputs=size,
        parameters=system.parameters.size,
        powers=input_powers,
        prepared=len(parts.setup.output("prepared")),
        ready=len(record.setup.output("prepared")),
        functions="\n".join(routines),
        step=parts.step,
        run=parts.run.replace("{record}", _RECORD if reduction is None else _REDUCE),
    )


def _plain_parts(system: HybridSystem, method: Method, lanes: int) -> ProgramParts:
    rate = prepare(system.rate)
    code = "\n".join(stage_lines(method))
    step = _RUNGE_KUTTA.format(name=method.name, code=code) + extension_text(method)
    setup, text = rate_text(system.state, rate.setup, finished(rate.body), lanes)
    return ProgramParts(setup=setup, routines=(text,), step=step, run=_RUN)


def _update(system: HybridSystem) -> str:
    if system.update is not None:
        return c_function(simplified(system.update), "update", inputs=ARGUMENTS, output="next")
    arguments = ", ".join(f"const double *restrict {name}" for name in ARGUMENTS)
    unused = " ".join(f"(void){name};" for name in (*ARGUMENTS, "next"))
    return f"static void update({arguments}, double *restrict next)\n{{\n    {unused}\n}}\n"
