"""What this machine's floating-point units need at least for a program's operations.

The same numbers of the same operations, in the same vectors, but independent of one another and
on values that never leave the registers: nothing is loaded, stored, addressed or waited for. No
order of the program's operations can be faster, unless it has fewer of them.
"""

from __future__ import annotations

from collections import Counter

import casadi as ca

from mrac_design.codegen.c_source import support
from mrac_design.codegen.straight_line import CONSTANT, FMA, FMS, FNMA, INPUT, StraightLine

CHAINS = 16
"""Values that are worked on in turn: enough to hide that an operation takes four cycles."""
_STATEMENTS = {
    ca.OP_ADD: "{0} = {0} + b;",
    ca.OP_SUB: "{0} = {0} - b;",
    ca.OP_MUL: "{0} = {0} * c;",
    ca.OP_DIV: "{0} = {0} / c;",
    ca.OP_FABS: "{0} = real_abs({0});",
    FMA: "{0} = real_fma({0}, c, b);",
    FMS: "{0} = real_fms({0}, c, b);",
    FNMA: "{0} = real_fnma({0}, c, b);",
}
_FREE = (INPUT, CONSTANT, ca.OP_NEG)
"""Changes of sign go with an operation before or after."""
_SOURCE = """\
#include <math.h>
{support}
void work(long n, const double *constants, real *results)
{{
    const real c = splat(constants[0]), b = splat(constants[1]);
    real {values};
    for (long i = 0; i < n; ++i) {{
{statements}
    }}
{results}
}}
"""


def limit_source(program: StraightLine, lanes: int) -> str:
    """C source of `work(n, {c, b}, results)`: n times the operations of `program`, not its data.

    `results` holds `CHAINS` values of `lanes` numbers.
    """
    left = Counter(n.operation for n in program.nodes if n.operation not in _FREE)
    total, statements = sum(left.values()), []
    wanted = {operation: count / total for operation, count in left.items()}
    done: Counter[int] = Counter()
    for number in range(total):
        # The kind that is furthest behind its share comes next, so that all are spread evenly.
        kind = max(left, key=lambda k: wanted[k] * (number + 1) - done[k])
        done[kind] += 1
        statements.append(8 * " " + _STATEMENTS[kind].format(f"x{number % CHAINS}"))
    names = [f"x{k}" for k in range(CHAINS)]
    return _SOURCE.format(
        support=support(lanes),
        values=", ".join(f"{name} = c" for name in names),
        statements="\n".join(statements),
        results="\n".join(f"    results[{k}] = {name};" for k, name in enumerate(names)),
    )
