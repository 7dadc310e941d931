"""`mrac certify`, `verify`, `stability`: certificates of the adaptive loop, made and re-checked."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from mrac_design.cli.console import print_json, progress_bar
from mrac_design.cli.options import DesignOptions, JsonOption, StudyOptions, takes


@takes(DesignOptions)
def certify(
    options: DesignOptions,
    out: Annotated[Path, typer.Option(help="Where the certificate goes.")] = Path(
        "certificate.json"
    ),
    box: Annotated[
        str | None,
        typer.Option(help="Share the gains may leave nominal by, as 0.4; without: the largest."),
    ] = None,
    softest: Annotated[str | None, typer.Option(help="Least tissue stiffness (N/m).")] = None,
    stiffest: Annotated[str | None, typer.Option(help="Greatest tissue stiffness (N/m).")] = None,
    rate: Annotated[
        int | None, typer.Option(help="Sample rate (Hz); without: continuous time.")
    ] = None,
    delay: Annotated[int, typer.Option(help="Computational delay, whole samples.")] = 1,
) -> None:
    """Prove the loop stable for every path of its gains inside a box, and keep the proof.

    Example: mrac certify --box 0.4 --softest 800 --stiffest 1200 --out certificate.json

    Exit status: 0 when proved, 1 when not (nothing is written then).
    """
    from mrac_design.controller.axis_loop import axis_loop
    from mrac_design.stability.certificate_file import write_certificate
    from mrac_design.stability.certification import certify as prove
    from mrac_design.stability.certification import largest_box
    from mrac_design.stability.parameter_box import relative_box
    from mrac_design.stability.sampled_loop import Sampling, sampling
    from mrac_design.study import scenario_design
    from mrac_design.time_domain import Continuous
    from mrac_design.verdict import Verdict

    scenario = options.chosen()
    choice = scenario.design
    timing = Continuous() if rate is None else sampling(f"1/{rate}", delay)
    periods = [timing.period] if isinstance(timing, Sampling) else []
    loop = axis_loop(scenario_design(scenario), periods)
    tissue = (softest or choice.stiffness, stiffest or choice.stiffness)
    fraction = box or largest_box(loop, tissue, timing, resolution="0.01").fraction
    certificate = prove(loop, relative_box(loop, fraction, tissue), timing)
    if certificate.verdict is not Verdict.PROVED:
        typer.echo(f"{certificate.verdict.value}: {certificate.reason}", err=True)
        raise typer.Exit(1)
    write_certificate(certificate, out)
    typer.echo(f"proved, gains within ±{100 * float(fraction):g} %: {certificate.reason}")
    typer.echo(f"decay rate {certificate.decay_rate:.4g} 1/s")
    peak = "not found" if certificate.peak is None else f"{certificate.peak_gain:.4g} N/(m/s²)"
    typer.echo(f"peak gain, heart acceleration to force: {peak}")
    typer.echo(f"certificate: {out}")


def verify(
    certificate: Annotated[Path, typer.Argument(help="A certificate.json.")],
) -> None:
    """Re-check a certificate in exact arithmetic, without designer or solver.

    Example: mrac verify certificate.json

    Exit status: 0 accepted, 1 refused (the failing line is named), 2 not readable.
    """
    from mrac_design.verify.__main__ import main

    sys.exit(main([str(certificate)]))


@takes(StudyOptions)
def stability(
    options: StudyOptions,
    out: Annotated[Path, typer.Option(help="Folder for the report.")] = Path("reports/stability"),
    choices: Annotated[
        str, typer.Option(help="What to certify and how hard to try it: packaged or a TOML file.")
    ] = "paper",
    as_json: JsonOption = False,
) -> None:
    """Write the stability report: what is proved, checked, assumed and violated.

    Example: mrac stability --out reports/stability
    """
    from mrac_design.report.stability_report import write_stability_report

    with progress_bar("stability") as progress:
        report = write_stability_report(
            options.chosen(),
            out,
            choices=choices,
            progress=progress,
        )
    if as_json:
        print_json(report.values)
        return
    typer.echo(f"asymptotic stability by the feedforward theorem: {report.values['theorem_5_9']}")
    for title, found in report.values["designs"].items():
        typer.echo(f"{title}, gains within ±{100 * found['box']:g} %: {found['verdict']}")
        for bound, ratio in found["bound_over_simulated"].items():
            typer.echo(f"  {bound.replace('$', '')}: bound over simulated {ratio:.3g}")
    for certificate in report.certificates:
        typer.echo(f"certificate: {certificate}")
    typer.echo(f"Report: {out / 'report.html'}")
