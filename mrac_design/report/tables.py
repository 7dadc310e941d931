"""Tables that notebooks and the report show, and the tables of a study."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mrac_design.report.paper import PAPER_TORQUE_LIMIT, paper_error, paper_simulation
from mrac_design.study import VARIANTS, StudyRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A captioned table of ready-made cells, shown as Markdown; a bar in a cell is escaped."""

    caption: str
    """Markdown below the table's number."""
    header: tuple[str, ...]
    """Column titles."""
    rows: tuple[tuple[str, ...], ...]
    """Cells, each row as long as the header."""
    numeric: tuple[int, ...] = ()
    """Columns set flush right."""

    def __post_init__(self) -> None:
        assert all(len(row) == len(self.header) for row in self.rows), self.caption

    def _repr_markdown_(self) -> str:
        rules = ["--:" if i in self.numeric else ":--" for i in range(len(self.header))]
        lines = [_row(self.header), f"|{'|'.join(rules)}|", *map(_row, self.rows)]
        return "\n".join([*lines, "", f": {self.caption}"])


@dataclass(frozen=True, slots=True)
class Quantity:
    """One line of a provenance table."""

    name: str
    """What it is, Markdown."""
    value: str
    """Value with unit, Markdown."""
    origin: str
    """Recorded, fitted, published, assumed or derived."""
    remark: str
    """Where it comes from, or why this value."""


def comparison_table(study: StudyRecord) -> Table:
    """Largest force error (% of the largest desired force): the paper's beside every variant."""
    simulation = paper_simulation(study.scenario)
    theirs = () if simulation is None else ("[Z], adaptive",)
    said = (
        "[Z] has no simulation under these conditions."
        if simulation is None
        else f"The figures of [Z], simulation {simulation.number}, are for its own robot, "
        "recording and reference, which are not public; – where it gives none."
    )
    return Table(
        caption=(
            "Largest force error $|y - F_d|$ in per cent of the axis's largest desired force, "
            f"after the first {study.scenario.simulation.settling:g} s. {said}"
        ),
        header=("axis", *theirs, *(variant.title for variant in VARIANTS)),
        rows=tuple(
            (
                axis,
                *(paper_error(simulation, axis) for _ in theirs),
                *largest_errors(study, axis),
            )
            for axis in study.robot.force_axes
        ),
        numeric=tuple(range(1, 1 + len(theirs) + len(VARIANTS))),
    )


def largest_errors(study: StudyRecord, axis: str) -> tuple[str, ...]:
    """Cells: largest force error (% of the axis's largest desired force), variant by variant."""
    return tuple(
        f"{study.tracking[variant.name][axis].max_force_error_percent:.3g} %"
        for variant in VARIANTS
    )


def tracking_table(study: StudyRecord) -> Table:
    """All figures of merit of every variant and axis, in mN."""
    rows = []
    for variant in VARIANTS:
        for axis in study.robot.force_axes:
            m = study.tracking[variant.name][axis]
            errors = (
                m.max_force_error_N,
                m.rms_force_error_N,
                m.max_model_error_N,
                m.rms_model_error_N,
            )
            rows.append((variant.title, axis, *(f"{1e3 * error:.3g}" for error in errors)))
    return Table(
        caption=(
            "Force errors in mN, largest magnitude and rms: to the desired force $F_d$, and to "
            "the output $y_m$ of the reference model."
        ),
        header=("controller", "axis", "max $y - F_d$", "rms", "max $y - y_m$", "rms"),
        rows=tuple(rows),
        numeric=(2, 3, 4, 5),
    )


def torque_table(study: StudyRecord) -> Table:
    """Largest torque of each motor (N·m) for every variant beside its limit."""
    limits = study.robot.motor_torque_limits
    return Table(
        caption=(
            "Largest torque of each motor in N·m, beside its limit; [Z] limits every actuator "
            f"to {PAPER_TORQUE_LIMIT:g} N·m."
        ),
        header=("motor", "limit", *(variant.title for variant in VARIANTS)),
        rows=tuple(
            (
                joint.name,
                f"{limits[i]:g}",
                *(f"{study.max_torque[variant.name][joint.name]:.3g}" for variant in VARIANTS),
            )
            for i, joint in enumerate(study.robot.joints)
        ),
        numeric=(1, 2, 3, 4),
    )


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"
