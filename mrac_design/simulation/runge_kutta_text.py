"""C text of explicit Runge–Kutta steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrac_design.simulation.method import Method
from mrac_design.simulation.tableau import ButcherTableau, ContinuousExtension

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

"""
_BETWEEN = """\
/* The state after the share `theta` of the step of length h from `base`. */
static void between(const real *restrict base, real (*restrict k)[WIDTH + 1], double h,
                    double theta, real *restrict y)
{{
{weights}
    for (int i = 0; i < WIDTH; ++i) y[i] = {value};
}}
"""

_WATCHED_EXTENSION = """\
/* Further evaluations of the step from `base`, at whose end the slope is `last`, that tell the
   solution between them. */
static void extend(const real *restrict base, const real *restrict last, const real *restrict z,
                   const real *restrict segment, const real *restrict p,
                   const real *restrict prepared, double s, double h,
                   real (*restrict k)[WIDTH + 1], real *restrict y)
{{
    real v[NV + 1], values[EVENTS];
    memcpy(k[{first}], last, sizeof k[0]);
{code}
}}

"""

NO_EXTENSION = """\
#define extend(base, x, z, c, p, prepared, since, h, k, y) (void)0
#define between(base, k, h, theta, y) (void)0
"""


def evaluations(method: Method) -> int:
    """Slopes kept of a step."""
    return method.stages if method.extension is None else method.extension.weights.shape[0]


def extension_text(method: ButcherTableau) -> str:
    """Functions `extend` and `between`, or what stands for them where there is no extension."""
    extension = method.extension
    if extension is None:
        return NO_EXTENSION
    lines = [
        "    inputs_at(segment, splat(s + h), v);",
        f"    rate(x, z, v, p, prepared, k[{method.stages}]);",
        *_extension_lines(method, extension, _RATE),
    ]
    return _EXTENSION.format(code="\n".join(lines)) + _between(extension)


def watched_extension_text(method: ButcherTableau) -> str:
    """The same where event functions go with the rate, and its value at the end is known."""
    extension = method.extension
    if extension is None:
        return NO_EXTENSION
    code = "\n".join(_extension_lines(method, extension, _WATCHED_RATE))
    return _WATCHED_EXTENSION.format(first=method.stages, code=code) + _between(extension)


def stage_lines(method: ButcherTableau) -> list[str]:
    """Statements of a step of x from s over h."""
    return [
        "    inputs_at(segment, splat(s + 0.0 * h), v);",
        "    rate(x, z, v, p, prepared, k[0]);",
        *_later_stages(method, _RATE),
        f"    for (int i = 0; i < WIDTH; ++i) x[i] = {_combination(method.b)};",
    ]


def watched_stage_lines(method: ButcherTableau) -> list[str]:
    """Statements of a step from x to `following` whose first slope is in k[0]."""
    return [
        *_later_stages(method, _WATCHED_RATE),
        f"    for (int i = 0; i < WIDTH; ++i) following[i] = {_combination(method.b)};",
    ]


_RATE = "    rate({at}, z, v, p, prepared, k[{stage}]);"
_WATCHED_RATE = "    rate({at}, z, v, p, prepared, k[{stage}], values);"


def _later_stages(method: ButcherTableau, rate: str) -> list[str]:
    lines = []
    for stage in range(1, method.stages):
        lines.append(f"    for (int i = 0; i < WIDTH; ++i) y[i] = {_combination(method.a[stage])};")
        # A stage at the same instant as the one before sees the same input.
        if method.c[stage] != method.c[stage - 1]:
            time = f"s + {float(method.c[stage])!r} * h"
            lines.append(f"    inputs_at(segment, splat({time}), v);")
        lines.append(rate.format(at="y", stage=stage))
    return lines


def _extension_lines(
    method: ButcherTableau, extension: ContinuousExtension, rate: str
) -> list[str]:
    lines = []
    for number, (row, fraction) in enumerate(zip(extension.a, extension.c, strict=True)):
        value = _combination(row).replace("x[i]", "base[i]")
        lines += [
            f"    for (int i = 0; i < WIDTH; ++i) y[i] = {value};",
            f"    inputs_at(segment, splat(s + {float(fraction)!r} * h), v);",
            rate.format(at="y", stage=method.stages + 1 + number),
        ]
    return lines


def _between(extension: ContinuousExtension) -> str:
    weights, terms = [], []
    for number, row in enumerate(extension.weights):
        if not row.any():
            continue
        value = repr(float(row[-1]))
        for weight in row[-2::-1]:
            value = f"({value} * theta + {float(weight)!r})"
        weights.append(f"    const double b{number} = {value} * theta;")
        terms.append((f"b{number}", f"k[{number}][i]"))
    return _BETWEEN.format(weights="\n".join(weights), value=_from("base[i]", terms))


def _combination(weights: np.ndarray) -> str:
    return _from("x[i]", [(repr(float(w)), f"k[{i}][i]") for i, w in enumerate(weights) if w != 0])


def _from(start: str, terms: Sequence[tuple[str, str]]) -> str:
    """start + h Σ weight · slope, a rounding for each term."""
    (weight, slope), *others = terms
    text = f"{weight} * {slope}"
    for weight, slope in others:
        text = f"real_fma(splat({weight}), {slope}, {text})"
    return f"real_fma(splat(h), {text}, {start})"
