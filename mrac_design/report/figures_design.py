"""Pictures of a controller design: poles, loop gain, sensitivities, positive realness."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mrac_design.arrays import FloatArray
from mrac_design.design import FeedbackLoop, RSTDesign
from mrac_design.plant import ForcePlant
from mrac_design.polynomials.rationals import roots
from mrac_design.report.style import (
    COLOURS,
    SERIES_COLOURS,
    CaptionedFigure,
    legend_above,
    new_figure,
    styled,
)
from mrac_design.stability.factorisation import Factorisation
from mrac_design.verdict import Verdict

STIFFNESS_RANGE = (0.5, 2.0)
"""True over assumed stiffness shown in the pole map."""

_BEAT = (0.8, 2.0)
"""Heart rates (Hz) marked in pictures over frequency: 50 to 120 beats a minute."""


@styled()
def pole_figure(design: RSTDesign) -> CaptionedFigure:
    """Poles (rad/s) of plant, controller and closed loop, and their paths when Ks is wrong."""
    low, high = STIFFNESS_RANGE
    figure = new_figure(
        3.4,
        "Poles. The plant's and the frozen controller's, those of the closed loop, and the path "
        f"of the latter while the true stiffness goes from {low:g} to {high:g} times the assumed.",
    )
    ax = figure.subplots()
    draw_poles(ax, design)
    legend_above(figure, ax.get_legend_handles_labels()[0])
    return figure


def draw_poles(ax: Axes, design: RSTDesign) -> None:
    """The pole map of `pole_figure` on given axes."""
    factors = np.geomspace(*STIFFNESS_RANGE, 81)
    assumed = design.specification.plant.stiffness
    paths = np.concatenate([loop_on(design, factor * assumed).poles for factor in factors])
    paths = np.concatenate([paths, paths.conj()])
    ax.plot(paths.real, paths.imag, ".", color="#b9d6e8", markersize=3, label="wrong stiffness")
    groups = (
        ("plant", design.loop.process.A, "x", COLOURS["frozen"]),
        ("controller", design.loop.R, "+", COLOURS["adaptive_inverse"]),
    )
    for label, polynomial, marker, colour in groups:
        places = roots(polynomial)
        ax.plot(places.real, places.imag, marker, color=colour, markersize=8, label=label, mew=1.6)
    poles = design.closed_loop_poles
    colour = COLOURS["adaptive"]
    ax.plot(poles.real, poles.imag, "x", color=colour, markersize=8, mew=1.8, label="closed loop")
    _note_multiplicity(ax, poles)
    ax.axvline(0, color=COLOURS["limit"], linewidth=0.8)
    ax.set_xlabel("Re $p$ (rad/s)")
    ax.set_ylabel("Im $p$ (rad/s)")
    ax.margins(0.08, 0.15)


def loop_on(design: RSTDesign, stiffness: float) -> FeedbackLoop:
    """The design's controller, frozen, on tissue of a true `stiffness` (N/m)."""
    velocity_gain = design.specification.plant.velocity_gain
    true = ForcePlant(stiffness=stiffness, velocity_gain=velocity_gain)
    return replace(design.loop, process=true.process)


@styled()
def loop_figure(design: RSTDesign) -> CaptionedFigure:
    """Bode diagram of the loop gain with crossover, phase and delay margin."""
    margins = design.margins()
    figure = new_figure(
        4.2,
        "Loop gain $b_0 S/(A R)$ with the gains frozen: crossover "
        f"{margins.crossover_frequency:.3g} rad/s, phase margin "
        f"{math.degrees(margins.phase_margin):.3g}°, delay margin "
        f"{1e3 * margins.delay_margin:.3g} ms, modulus margin {margins.modulus_margin:.3g}.",
    )
    magnitude, phase = figure.subplots(2, 1, sharex=True)
    omega = _frequencies(design)
    gain = design.loop_transfer()(1j * omega)
    magnitude.loglog(omega, np.abs(gain), color=COLOURS["adaptive"])
    angle = np.degrees(np.unwrap(np.angle(gain)))
    phase.semilogx(omega, angle, color=COLOURS["adaptive"])
    crossover = margins.crossover_frequency
    for ax in (magnitude, phase):
        ax.axvline(crossover, color=COLOURS["limit"], linestyle=(0, (4, 2)), linewidth=0.9)
    magnitude.axhline(1, color=COLOURS["limit"], linewidth=0.8)
    at_crossover = float(np.interp(crossover, omega, angle))
    phase.plot([crossover] * 2, [-180, at_crossover], color=COLOURS["frozen"], linewidth=2.2)
    phase.axhline(-180, color=COLOURS["limit"], linewidth=0.8)
    magnitude.set_ylabel("gain (–)")
    phase.set_ylabel("phase (°)")
    phase.set_xlabel("frequency (rad/s)")
    figure.align_ylabels()
    return figure


@styled()
def sensitivity_figure(design: RSTDesign) -> CaptionedFigure:
    """What heart motion does to the force (N/mm), and noise and reference to the output (–)."""
    figure = new_figure(
        3.0,
        "Sensitivities with the gains frozen. Left: force error for a millimetre of heart motion, "
        "$K_s|S_d|$; shaded are heart rates of 50 to 120 beats a minute. Right: from the "
        "desired force (the reference model itself) and from sensor noise to the force.",
    )
    heart, force = figure.subplots(1, 2)
    draw_heart_sensitivity(heart, design.loop, design.specification.plant.stiffness)
    omega = _frequencies(design)
    force.loglog(
        omega,
        np.abs(design.reference_transfer()(1j * omega)),
        color=COLOURS["desired"],
        label="reference to force",
    )
    force.loglog(
        omega,
        np.abs(design.complementary_sensitivity()(1j * omega)),
        color=COLOURS["frozen"],
        label="sensor noise to force",
    )
    force.set_xlabel("frequency (rad/s)")
    force.set_ylabel("gain (–)")
    lines = [*heart.get_lines(), *force.get_lines()]
    legend_above(figure, [line for line in lines if not str(line.get_label()).startswith("_")])
    return figure


def draw_heart_sensitivity(ax: Axes, loop: FeedbackLoop, stiffness: float) -> None:
    """Force error over heart motion (N/mm) against frequency (Hz), gains frozen.

    `stiffness` is the Ks (N/m) in the process of `loop`.
    """
    hertz = np.geomspace(0.1, 300, 400)
    gain = 1e-3 * stiffness * np.abs(loop.disturbance_sensitivity()(2j * np.pi * hertz))
    ax.loglog(hertz, gain, color=COLOURS["heart"], label="heart motion to force")
    ax.axvspan(*_BEAT, color=COLOURS["heart"], alpha=0.15, linewidth=0)
    ax.set_xlabel("frequency (Hz)")
    ax.set_ylabel("force error (N/mm)")


@styled()
def realness_figure(factorisations: Sequence[Factorisation], bandwidth: float) -> CaptionedFigure:
    """Phase of G1 along the imaginary axis for each splitting (°), and ω² Re G1 (scaled, –).

    `bandwidth` (rad/s) is the middle of the frequency range drawn.
    """
    figure = new_figure(
        3.5,
        "First factors $G_1(j\\omega)$. Left: phase; a strictly positive real function stays "
        "inside the shaded band of ±90°. Right: $\\omega^2\\,\\mathrm{Re}\\,G_1$ over its largest "
        "value, for those of relative degree 1 and more; at high frequency it must stay away "
        "from zero. Dashed: not strictly positive real.",
    )
    phase, weighted = figure.subplots(1, 2)
    omega = bandwidth * np.geomspace(1e-4, 1e3, 400)
    for row, colour in zip(factorisations, SERIES_COLOURS, strict=False):
        system = row.first.transfer_function()
        value = system(1j * omega)
        strict = row.strict.verdict is Verdict.PROVED
        style = {"color": colour, "linestyle": "-" if strict else (0, (4, 2))}
        phase.semilogx(omega, np.degrees(np.angle(value)), label=_first_factor(row), **style)
        if len(system.den[0][0]) > len(system.num[0][0]):
            bent = omega**2 * value.real
            weighted.semilogx(omega, bent / np.abs(bent).max(), **style)
    phase.axhspan(-90, 90, color=COLOURS["adaptive_inverse"], alpha=0.08, linewidth=0)
    phase.set_yticks(range(-180, 91, 45))
    weighted.axhline(0, color=COLOURS["limit"], linewidth=0.8)
    for ax in (phase, weighted):
        ax.set_xlabel("frequency (rad/s)")
    phase.set_ylabel("phase of $G_1$ (°)")
    weighted.set_ylabel("$\\omega^2$ Re $G_1$, scaled (–)")
    legend_above(figure, phase.get_legend_handles_labels()[0], columns=3)
    return figure


def _note_multiplicity(ax: Axes, poles: NDArray[np.complex128]) -> None:
    counts = Counter(np.round(poles, 3).tolist())
    for pole, count in counts.items():
        if count > 1:
            ax.annotate(
                f"{count}-fold",
                (pole.real, pole.imag),
                xytext=(0, 9),
                textcoords="offset points",
                ha="center",
            )


def _frequencies(design: RSTDesign) -> FloatArray:
    return design.specification.reference_model.bandwidth * np.geomspace(1e-3, 1e2, 400)


def _first_factor(row: Factorisation) -> str:
    """G1 as Matplotlib sets it, from the splitting's name in plain letters."""
    text = row.name.split(" · ")[0]
    for plain, subscript in (("Ks", "K_s"), ("K2", "K_2"), ("Am", "A_m")):
        text = text.replace(plain, subscript)
    return f"${text}$"
