"""Pictures as files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from mrac_design.publishing import publish_folder, staging_folder
from mrac_design.report import figures_study as draw
from mrac_design.report.figures_paper import positions_figure
from mrac_design.report.paper import PaperStudy, paper_simulation
from mrac_design.report.style import CaptionedFigure, styled
from mrac_design.study import StudyRecord

Pictures = Mapping[str, Callable[[], CaptionedFigure]]
"""File name (without suffix) → what draws the picture."""


def study_figures(study: StudyRecord) -> Pictures:
    """All pictures of a study; one that [Z] has too carries its number there."""
    forces = {
        _named(study, f"force {name}"): partial(draw.force_figure, study, i)
        for i, name in enumerate(study.robot.force_axes)
    }
    return {
        _named(study, "heart motion"): partial(draw.heart_motion_figure, study),
        **forces,
        _named(study, "positions"): partial(draw.compensation_figure, study),
        _named(study, "torques"): partial(draw.torque_figure, study),
        "gains": partial(draw.gains_figure, study),
        "errors": partial(draw.error_figure, study),
        "overview": partial(draw.overview_figure, study),
    }


def paper_figures(studies: tuple[PaperStudy, ...]) -> Pictures:
    """Figures 5 to 13 of [Z], drawn anew."""
    nominal, parameters, stiffness = (item.study for item in studies)
    axes = enumerate(nominal.robot.force_axes)
    return {
        _named(nominal, "heart motion"): partial(draw.heart_motion_figure, nominal),
        **{
            _named(nominal, f"force {name}"): partial(draw.force_figure, nominal, i)
            for i, name in axes
        },
        _named(nominal, "positions"): partial(positions_figure, nominal),
        _named(nominal, "torques"): partial(draw.torque_figure, nominal),
        _named(parameters, "positions"): partial(positions_figure, parameters),
        _named(stiffness, "positions"): partial(positions_figure, stiffness),
        _named(stiffness, "torques"): partial(draw.torque_figure, stiffness),
    }


def save_figures(pictures: Pictures, directory: Path) -> tuple[Path, ...]:
    """Write every picture to `directory` as PNG and SVG; returns the paths.

    The folder appears, or is replaced, only when all pictures are finished.
    """
    names = []
    with staging_folder(directory) as scratch:
        staged = scratch / "figures"
        staged.mkdir()
        for name, picture in pictures.items():
            figure = picture()
            (staged / f"{name}.svg").write_text(figure.svg(), encoding="utf-8")
            with styled():
                figure.savefig(staged / f"{name}.png")
            names += [f"{name}.png", f"{name}.svg"]
        publish_folder(staged, directory)
    return tuple(directory / name for name in names)


def _named(study: StudyRecord, key: str) -> str:
    """File name of a picture: its key, after its number in [Z] if it has one."""
    simulation = paper_simulation(study.scenario)
    number = None if simulation is None else simulation.figures.get(key)
    name = key.lower().replace(" ", "_")
    return name if number is None else f"figure_{number:02d}_{name}"
