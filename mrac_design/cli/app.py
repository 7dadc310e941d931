"""The `mrac` command: from a scenario to numbers, designs and reports."""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from mrac_design.cli.certify import certify, stability, verify
from mrac_design.cli.compare import compare
from mrac_design.cli.console import MessageHandler, messages, output, print_json, progress_bar
from mrac_design.cli.drift import drift
from mrac_design.cli.ensemble import ensemble
from mrac_design.cli.export import export
from mrac_design.cli.options import DesignOptions, JsonOption, StudyOptions, takes
from mrac_design.cli.paper import paper
from mrac_design.cli.realtime import realtime
from mrac_design.cli.tune import tune
from mrac_design.errors import MracDesignError

if TYPE_CHECKING:  # loading it takes longer than `--help` should
    from mrac_design.study import StudyRecord


class _Commands(TyperGroup):
    """The commands; one that is interrupted ends with a sentence and status 130."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command that was given."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            messages().print("interrupted; nothing half-written was left behind")
            raise typer.Exit(130) from None


app = typer.Typer(
    cls=_Commands,
    help="Design, certify, simulate and deploy model reference adaptive force control.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


@app.callback()
def _setup(
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Say more.")] = False,
) -> None:
    logging.basicConfig(
        level=logging.INFO if verbose else logging.WARNING,
        format="%(message)s",
        handlers=[MessageHandler()],
    )


@app.command()
@takes(StudyOptions)
def report(
    options: StudyOptions,
    out: Annotated[Path, typer.Option(help="Folder for the report.")] = Path("reports/nominal"),
    as_json: JsonOption = False,
) -> None:
    """Run a study and write it up: report.html, report.pdf, values.json, gains.json, figures/.

    Example: mrac report --motion heart.csv --frame-rate 25 --out reports/my_heart
    """
    from mrac_design.export.values import study_values
    from mrac_design.report.study_report import write_study_report

    with progress_bar("report") as progress:
        study = write_study_report(options.chosen(), out, progress=progress)
    if as_json:
        print_json({"out": str(out), **study_values(study)})
    else:
        _print_study(study)
        output().print(f"Report: {out / 'report.html'}")


@app.command()
@takes(StudyOptions)
def simulate(
    options: StudyOptions,
    out: Annotated[
        Path | None, typer.Option(help="Folder for values.json and the trajectories (.npz).")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Simulate a scenario with the frozen and the adaptive controllers and print the errors.

    Example: mrac simulate --duration 10 --stiffness 1200
    """
    from mrac_design.study import run_study

    chosen = options.chosen()
    with progress_bar("simulation") as progress:
        study = run_study(chosen, progress=lambda fraction: progress("simulating", fraction))
    if out is not None:
        from mrac_design.export.trajectories import write_trajectories

        write_trajectories(study, out)
    if as_json:
        from mrac_design.export.values import study_values

        print_json(study_values(study))
    else:
        _print_study(study)


@app.command()
@takes(DesignOptions)
def design(options: DesignOptions, as_json: JsonOption = False) -> None:
    """Solve the Diophantine equation of a scenario and print gains, poles and margins.

    Example: mrac design --omega 300 --ao 300 --k2 30
    """
    from mrac_design.export.gains import gains_document
    from mrac_design.study import scenario_design

    chosen = options.chosen()
    result = scenario_design(chosen)
    margins = result.margins()
    poles = [[float(pole.real), float(pole.imag)] for pole in result.closed_loop_poles]
    if as_json:
        print_json(
            {
                **gains_document(chosen, result),
                "residual": result.residual,
                "closed_loop_poles": poles,
                "margins": {name: getattr(margins, name) for name in margins.__slots__},
            }
        )
        return
    from rich.table import Table

    table = Table("gain", "value", title=chosen.title)
    for name, value, _ in result.coefficients:
        table.add_row(name, f"{value:.6g}")
    output().print(table)
    output().print("closed-loop poles: " + ", ".join(f"{a:.4g}{b:+.4g}j" for a, b in poles))
    for name in margins.__slots__:
        output().print(f"{name.replace('_', ' ')}: {getattr(margins, name):.4g}")
    output().print(f"relative residual of the Diophantine equation: {result.residual:.2g}")


@app.command("check-model")
def check_model(
    robot: Annotated[str, typer.Argument(help="A packaged robot or a robot file (TOML).")],
    as_json: JsonOption = False,
) -> None:
    """Read a robot file strictly and report what it describes.

    Example: mrac check-model my_robot.toml
    """
    import numpy as np

    from mrac_design.robot import (
        build_dynamics,
        condition_number,
        inertial_parameters,
        load_robot,
    )

    description = load_robot(robot)
    dynamics = build_dynamics(description)
    home, parameters = description.home, inertial_parameters(description)
    mass = dynamics.mass_matrix(home, parameters).full()
    facts = {
        "robot": description.name,
        "provenance": description.provenance,
        "joints": [joint.name for joint in description.joints],
        "force_axes": list(description.force_axes),
        "tip_at_home_m": dynamics.forward_kinematics(home)[1].full().ravel().tolist(),
        "jacobian_condition_at_home": condition_number(dynamics, home),
        "mass_matrix_eigenvalues_at_home": np.linalg.eigvalsh(mass).tolist(),
        "gravity_effort_at_home": dynamics.gravity_torque(home, parameters).full().ravel().tolist(),
    }
    if as_json:
        print_json(facts)
        return
    from rich.table import Table

    table = Table("fact", "value", title=f"{description.name}: a robot that can exist")
    for name, value in facts.items():
        table.add_row(name.replace("_", " "), _shown(value))
    output().print(table)


app.command()(paper)
app.command()(tune)
app.command()(export)
app.command()(certify)
app.command()(verify)
app.command()(stability)
app.command()(realtime)
app.command()(ensemble)
app.command()(compare)
app.command()(drift)


def main() -> None:
    """Entry point: one clear sentence and status 2 for whatever the user can mend."""
    try:
        app(prog_name="mrac")
    except MracDesignError as problem:
        messages().print(f"[bold red]error:[/] {_escaped(str(problem))}", soft_wrap=True)
        sys.exit(2)


def _print_study(study: StudyRecord) -> None:
    from rich.table import Column, Table

    from mrac_design.simulation.trajectory import event_texts

    title = f"{study.scenario.name} on {study.robot.name}, motion {study.motion.name}"
    table = Table(
        Column("controller", no_wrap=True, min_width=16), "axis", "max |y − Fd| %",
        "rms y − Fd mN", "max |y − ym| mN", "rms y − ym mN", title=title,
    )  # fmt: skip
    for variant, axes in study.tracking.items():
        for axis, metrics in axes.items():
            table.add_row(
                variant,
                axis,
                f"{metrics.max_force_error_percent:.3g}",
                f"{1e3 * metrics.rms_force_error_N:.3g}",
                f"{1e3 * metrics.max_model_error_N:.3g}",
                f"{1e3 * metrics.rms_model_error_N:.3g}",
            )
    output().print(table)
    for variant, peaks in study.max_torque.items():
        shown = ", ".join(f"{motor} {peak:.3g}" for motor, peak in peaks.items())
        output().print(f"largest torques (N·m), {variant}: {shown}")
    for variant, trajectory in study.trajectories.items():
        told = event_texts(trajectory.events, duration=study.scenario.simulation.duration)
        if told:
            output().print(f"events, {variant}: {'; '.join(told)}")
    output().print(f"ran on {next(iter(study.trajectories.values())).engine}")


def _shown(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(_shown(entry) for entry in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _escaped(text: str) -> str:
    from rich.markup import escape

    return escape(text)
