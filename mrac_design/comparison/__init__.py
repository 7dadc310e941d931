"""An honest comparison: every controller tuned alike, judged on motions it never saw.

setting, contestant → rst_contestants, rival_contestants → bench → tuning, judging → comparison →
findings, values. `limit` is the best any linear causal controller can do.
"""

from mrac_design.comparison.comparison import (
    Comparison,
    ComparisonSpecification,
    comparison_specification,
    contestants,
    load_specification,
    run_comparison,
    save_specification,
)
from mrac_design.comparison.findings import claims, findings, pareto_front, ranking
from mrac_design.comparison.limit import LinearLimit, linear_limit, motion_spectrum
from mrac_design.comparison.store import ComparisonStore
from mrac_design.comparison.values import comparison_values

__all__ = [
    "Comparison",
    "ComparisonSpecification",
    "ComparisonStore",
    "LinearLimit",
    "claims",
    "comparison_specification",
    "comparison_values",
    "contestants",
    "findings",
    "linear_limit",
    "load_specification",
    "motion_spectrum",
    "pareto_front",
    "ranking",
    "run_comparison",
    "save_specification",
]
