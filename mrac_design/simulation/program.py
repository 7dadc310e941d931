"""The C program of a hybrid system under an explicit Runge–Kutta method."""

from __future__ import annotations

import numpy as np

from mrac_design.simulation.emission import c_function, simplified
from mrac_design.simulation.system import HybridSystem
from mrac_design.simulation.tableau import ButcherTableau

_ARGUMENTS = ("x", "z", "v", "p")

_TEMPLATE = """\
#include <math.h>
#include <stddef.h>
#include <string.h>

enum {{ NX = {states}, NZ = {held}, NV = {inputs}, NY = {outputs}, POWERS = {powers} }};

{functions}
/* Value of the inputs at time s after the beginning of their segment. */
static void inputs_at(const double *restrict coefficients, double s, double *restrict v)
{{
    for (int i = 0; i < NV; ++i) {{
        const double *c = coefficients + (size_t)i * POWERS;
        double value = c[POWERS - 1];
        for (int k = POWERS - 2; k >= 0; --k) value = value * s + c[k];
        v[i] = value;
    }}
}}

/* One step of the {method} method from time s within the segment. */
static void step(double *restrict x, const double *restrict z, const double *restrict coefficients,
                 const double *restrict p, double s, double h)
{{
    double k[{stages}][NX + 1], y[NX + 1], v[NV + 1];
{stage_code}
}}

/* Runs n intervals; returns how many rows of `recorded` were written. */
long run(long n, const double *length, const long long *substeps, const long long *segment,
         const double *offset, const unsigned char *records, const unsigned char *updates,
         const double *coefficients, const double *p, double *x, double *z, double *recorded)
{{
    double v[NV + 1], next[NZ + 1];
    long rows = 0;
    for (long i = 0; i < n; ++i) {{
        const double *c = coefficients + (size_t)segment[i] * NV * POWERS;
        if (records[i] || updates[i]) inputs_at(c, offset[i], v);
        if (updates[i]) {{
            update(x, z, v, p, next);
            memcpy(z, next, NZ * sizeof *z);
        }}
        if (records[i]) output(x, z, v, p, recorded + NY * rows++);
        const double h = length[i] / (double)substeps[i];
        for (long long j = 0; j < substeps[i]; ++j)
            step(x, z, c, p, offset[i] + (double)j * h, h);
    }}
    return rows;
}}
"""


def c_program(system: HybridSystem, method: ButcherTableau, *, input_powers: int) -> str:
    """Source with one exported function, `run`; `input_powers` is the inputs' degree + 1."""
    functions = [
        c_function(simplified(system.rate), "rate", inputs=_ARGUMENTS, output="dx"),
        c_function(simplified(system.output), "output", inputs=_ARGUMENTS, output="y"),
        _update(system),
    ]
    return _TEMPLATE.format(
        states=system.state.size,
        held=system.held.size,
        inputs=system.inputs.size,
        outputs=system.outputs.size,
        powers=input_powers,
        functions="\n".join(functions),
        method=method.name,
        stages=method.stages,
        stage_code="\n".join(_stage_lines(method)),
    )


def _update(system: HybridSystem) -> str:
    if system.update is not None:
        return c_function(simplified(system.update), "update", inputs=_ARGUMENTS, output="next")
    arguments = ", ".join(f"const double *restrict {name}" for name in _ARGUMENTS)
    unused = " ".join(f"(void){name};" for name in (*_ARGUMENTS, "next"))
    return f"static void update({arguments}, double *restrict next)\n{{\n    {unused}\n}}\n"


def _stage_lines(method: ButcherTableau) -> list[str]:
    lines = []
    for stage in range(method.stages):
        if stage:
            lines.append(
                f"    for (int i = 0; i < NX; ++i) y[i] = {_combination(method.a[stage])};"
            )
        # A stage at the same instant as the one before sees the same input.
        if stage == 0 or method.c[stage] != method.c[stage - 1]:
            lines.append(f"    inputs_at(coefficients, s + {float(method.c[stage])!r} * h, v);")
        lines.append(f"    rate({'y' if stage else 'x'}, z, v, p, k[{stage}]);")
    lines.append(f"    for (int i = 0; i < NX; ++i) x[i] = {_combination(method.b)};")
    return lines


def _combination(weights: np.ndarray) -> str:
    terms = [f"{float(w)!r} * k[{i}][i]" for i, w in enumerate(weights) if w != 0]
    return f"x[i] + h * ({' + '.join(terms)})"
