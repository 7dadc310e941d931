"""Figures, tables and the rendering of notebooks to HTML and PDF; results come in finished.

style, paper → figures_*, tables*, provenance*, findings_paper → saving; execution, composition →
rendering → *_report, each of which writes the folder of one kind of report. What most notebooks
show is gathered here; what runs notebooks is imported by its own name, because a notebook has no
use for it.
"""

from mrac_design.report.figures_design import (
    loop_figure,
    pole_figure,
    realness_figure,
    sensitivity_figure,
)
from mrac_design.report.figures_robot import posture_figure
from mrac_design.report.figures_study import (
    compensation_figure,
    error_figure,
    force_figure,
    gains_figure,
    heart_motion_figure,
    overview_figure,
    torque_figure,
)
from mrac_design.report.provenance import scenario_provenance
from mrac_design.report.saving import save_figures
from mrac_design.report.tables import (
    Quantity,
    Table,
    comparison_table,
    torque_table,
    tracking_table,
)

__all__ = [
    "Quantity",
    "Table",
    "comparison_table",
    "compensation_figure",
    "error_figure",
    "force_figure",
    "gains_figure",
    "heart_motion_figure",
    "loop_figure",
    "overview_figure",
    "pole_figure",
    "posture_figure",
    "realness_figure",
    "save_figures",
    "scenario_provenance",
    "sensitivity_figure",
    "torque_figure",
    "torque_table",
    "tracking_table",
]
