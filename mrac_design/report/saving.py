"""All pictures of a study as files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from mrac_design.publishing import publish_folder, staging_folder
from mrac_design.report import figures_study as draw
from mrac_design.report.style import CaptionedFigure, styled
from mrac_design.study import StudyRecord

FigureFactory = Callable[[StudyRecord], CaptionedFigure]


def study_figures(study: StudyRecord) -> Mapping[str, FigureFactory]:
    """File name (without suffix) → what draws the picture; 05 to 10 are the figures of [Z]."""
    forces = {
        f"figure_{6 + i:02d}_force_{name.lower()}": partial(draw.force_figure, axis=i)
        for i, name in enumerate(study.robot.force_axes)
    }
    return {
        "figure_05_heart_motion": draw.heart_motion_figure,
        **forces,
        "figure_09_positions": draw.compensation_figure,
        "figure_10_torques": draw.torque_figure,
        "gains": draw.gains_figure,
        "errors": draw.error_figure,
        "overview": draw.overview_figure,
    }


def save_figures(study: StudyRecord, directory: Path) -> tuple[Path, ...]:
    """Write every picture of `study` to `directory` as PNG and SVG; returns the paths.

    The folder appears, or is replaced, only when all pictures are finished.
    """
    names = []
    with staging_folder(directory) as scratch:
        staged = scratch / "figures"
        staged.mkdir()
        for name, factory in study_figures(study).items():
            figure = factory(study)
            (staged / f"{name}.svg").write_text(figure.svg(), encoding="utf-8")
            with styled():
                figure.savefig(staged / f"{name}.png")
            names += [f"{name}.png", f"{name}.svg"]
        publish_folder(staged, directory)
    return tuple(directory / name for name in names)
