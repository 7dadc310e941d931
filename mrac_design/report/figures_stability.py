"""Pictures of the stability report: where proofs exist, how close simulation comes to them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from flint import fmpq
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap

from mrac_design.arrays import FloatArray, readonly
from mrac_design.assessment.adaptation_loop import AdaptationLoop
from mrac_design.assessment.hypotheses import Assessment
from mrac_design.assessment.mismatch import InertiaMismatch
from mrac_design.assessment.prediction import Prediction
from mrac_design.assessment.signals import AdaptationSignals
from mrac_design.assessment.worst_case import WorstCases
from mrac_design.design import RSTDesign
from mrac_design.polynomials.rationals import decimal_rational
from mrac_design.report.style import (
    COLOURS,
    SERIES_COLOURS,
    CaptionedFigure,
    legend_above,
    new_figure,
    stacked_axes,
    styled,
    thinned,
)
from mrac_design.stability import (
    DesignMap,
    RegionGrid,
    StabilityCertificate,
    candidate_conditions,
)
from mrac_design.stability.rational_function import to_float

_SHADES = LinearSegmentedColormap.from_list("share", ["#e3eef6", "#0072b2"])
_DASHED = (0, (4, 2))


@styled()
def region_figure(design: RSTDesign) -> CaptionedFigure:
    """Where two error models are strictly positive real, decided exactly on a grid."""
    specification = design.specification
    model, ao = specification.reference_model, specification.observer_pole
    omega, xi = model.bandwidth, model.damping
    own = decimal_rational(xi)
    figure = new_figure(
        2.9,
        "Where an error model is strictly positive real (shaded), every point decided in exact "
        r"arithmetic. Left: $(p+c)/A_m$, the variant without augmentation, over $c$ and $\xi$; its "
        r"border is $c = 2\xi\omega$. Right: $(p+c)^2/(A_oA_m)$ over $c$ and $a_o$ for the "
        "damping of this design. The cross marks a choice inside: $c = \\omega$, with the $\\xi$ "
        "and $a_o$ of this design.",
    )
    left, right = figure.subplots(1, 2)
    ratios = np.linspace(0.05, 3.0, 60)
    dampings = np.linspace(0.1, 1.5, 57)
    observers = np.linspace(0.1, 4.0, 60)

    grids = (
        _region("(p + c)/Am", ratios, dampings, lambda c, xi: {"c": c, "xi": xi}),
        _region("(p + c)²/(Ao Am)", ratios, observers, lambda c, ao: {"c": c, "ao": ao, "xi": own}),
    )
    for ax, grid in zip((left, right), grids, strict=True):
        _draw_region(ax, grid)
        ax.set_xlabel("$c/\\omega$ (–)")
        ax.grid(False)
    left.plot(2 * dampings, dampings, color=COLOURS["limit"], linestyle=_DASHED)
    left.set_xlim(0.05, 3.0)
    left.plot(1.0, xi, "x", color=COLOURS["frozen"], mew=1.8)
    right.plot(1.0, ao / omega, "x", color=COLOURS["frozen"], mew=1.8)
    left.set_ylabel("damping $\\xi$ (–)")
    right.set_ylabel("$a_o/\\omega$ (–)")
    return figure


def _region(
    name: str,
    first: FloatArray,
    second: FloatArray,
    letters: Callable[[fmpq, fmpq], Mapping[str, fmpq]],
) -> RegionGrid:
    """Where the condition of a function holds, exactly, with ω = 1 and time scaled by it."""
    condition = next(item for item in candidate_conditions() if item.name == name)
    one = fmpq(1)
    rest = {"K2": one, "omega": one, "xi": one, "ao": one}
    rows = [
        [
            condition.holds({**rest, **letters(decimal_rational(x), decimal_rational(y))})
            for y in second.tolist()
        ]
        for x in first.tolist()
    ]
    return RegionGrid(
        first=readonly(first), second=readonly(second), strictly_positive_real=np.array(rows)
    )


def _draw_region(ax: Axes, grid: RegionGrid) -> None:
    ax.pcolormesh(
        grid.first,
        grid.second,
        grid.strictly_positive_real.T.astype(float),
        cmap=LinearSegmentedColormap.from_list("region", ["#ffffff", "#cfe4f1"]),
        shading="nearest",
        edgecolors="face",
        linewidth=0.4,
        vmin=0,
        vmax=1,
    )


@styled()
def map_figure(found: DesignMap) -> CaptionedFigure:
    """The design map as a table of shaded cells."""
    low, high = found.stiffness_range
    rows, columns = found.fractions.shape
    figure = new_figure(
        0.9 + 0.42 * rows,
        "Largest certified box: every feedback gain may move within ± this share of nominal, at "
        f"any speed, on tissue of {low:g} to {high:g} N/m. A dash: not even the nominal gains are "
        f"certified. Steps of {100 * found.resolution:g} %; $a_o = \\omega$.",
    )
    ax = figure.subplots()
    ax.grid(False)
    ax.imshow(np.nan_to_num(found.fractions), cmap=_SHADES, aspect="auto", vmin=0, vmax=0.5)
    for i in range(rows):
        for j in range(columns):
            share = found.fractions[i, j]
            text = "–" if math.isnan(share) else f"±{100 * share:.0f} %"
            dark = not math.isnan(share) and share > 0.25
            ax.text(j, i, text, ha="center", va="center", color="white" if dark else "#1d232b")
    ax.set_xticks(
        range(columns),
        [f"{1 / to_float(s.period):g} Hz, delay {s.delay}" for s in found.samplings],
    )
    ax.set_yticks(range(rows), [f"{value:g}" for value in found.bandwidths])
    ax.set_ylabel("$\\omega$ (rad/s)")
    ax.tick_params(length=0)
    return figure


@styled()
def bounds_figure(cases: Mapping[str, WorstCases]) -> CaptionedFigure:
    """Certified bounds over the worst that hostile simulation found, by design."""
    figure = new_figure(
        2.4,
        "Certified bound over the worst value simulated, for each design. A point left of 1 would "
        "refute the certificate; a point near 1 shows that it is not conservative there.",
    )
    ax = figure.subplots()
    names = list(dict.fromkeys(item.name for found in cases.values() for item in found.comparisons))
    for number, (title, found) in enumerate(cases.items()):
        aside = 0.16 * (number - (len(cases) - 1) / 2)
        ratios = [item.ratio for item in found.comparisons]
        heights = [names.index(item.name) + aside for item in found.comparisons]
        ax.plot(ratios, heights, "o", color=SERIES_COLOURS[number], label=title)
    ax.axvline(1, color=COLOURS["frozen"], linestyle=_DASHED, label="refuted left of here")
    ax.set_xscale("log")
    ax.set_xlim(0.7, None)
    ax.set_xticks([1, 2, 5, 10, 20, 50], ["1", "2", "5", "10", "20", "50"])
    ax.set_yticks(range(len(names)), names)
    ax.invert_yaxis()
    ax.set_xlabel("bound / simulated (–)")
    legend_above(figure, ax.get_legend_handles_labels()[0], columns=3)
    return figure


@styled()
def excitation_figure(assessment: Assessment) -> CaptionedFigure:
    """Eigenvalues of the regressor's Gram matrix over windows of the run, by axis."""
    window = assessment.excitation[0].window
    figure = new_figure(
        2.7,
        "Persistent excitation: eigenvalues of $\\frac1T\\int\\hat\\varphi\\hat\\varphi^{\\mathsf "
        f"T}}dt$ over windows of $T$ = {window:g} s, largest to smallest. Adaptation would find the"
        " true gains only if the smallest stayed well above zero.",
    )
    panels = np.atleast_1d(figure.subplots(1, len(assessment.excitation), sharey=True))
    for ax, found in zip(panels, assessment.excitation, strict=True):
        for k in reversed(range(found.eigenvalues.shape[1])):
            ax.semilogy(
                found.centres,
                np.maximum(found.eigenvalues[:, k], 1e-14),
                ".-",
                color=SERIES_COLOURS[4 - k],
                label=f"$\\lambda_{k + 1}$",
            )
        ax.set_title(found.axis)
        ax.set_xlabel("middle of the window (s)")
    panels[0].set_ylabel("eigenvalue (N²)")
    legend_above(figure, panels[0].get_legend_handles_labels()[0])
    return figure


@styled()
def error_split_figure(signals: Sequence[AdaptationSignals]) -> CaptionedFigure:
    """The augmented error and its two parts, by axis (mN)."""
    figure = new_figure(
        1.1 + 1.15 * len(signals),
        "The augmented error $\\varepsilon$ and its two parts: what the gains cause, "
        "$\\hat\\varphi^{\\mathsf T}(\\hat\\theta^0-\\hat\\theta)$, and what the heart causes. "
        "The gains move so that the first cancels the second: adaptation here rejects a "
        "disturbance, it does not identify.",
    )
    axes = stacked_axes(figure, [f"{s.axis} (mN)" for s in signals], [1] * len(signals))
    for ax, part in zip(axes, signals, strict=True):
        for values, colour, label in (
            (part.from_heart, COLOURS["heart"], "from the heart"),
            (part.from_gains, COLOURS["adaptive_inverse"], "from the gains"),
            (part.augmented_error, COLOURS["desired"], "augmented error $\\varepsilon$"),
        ):
            ax.plot(*thinned(part.time, 1e3 * values), color=colour, label=label)
    legend_above(figure, axes[0].get_legend_handles_labels()[0])
    return figure


@styled()
def box_figure(assessment: Assessment, certificate: StabilityCertificate) -> CaptionedFigure:
    """Paths of r1', s0 … sn beside the certified box, relative to nominal (%)."""
    nominal = np.array([to_float(v) for v in certificate.loop.scaled_gains])
    upper = np.array([to_float(v) for v in certificate.box.upper])
    share = 100 * float((upper / nominal - 1).max())
    figure = new_figure(
        2.4,
        "Gains of the run, relative to nominal, each on a scale of its own. The certified box is "
        f"±{share:.3g} %.",
    )
    names = ("r_1'", *(f"s_{i}" for i in range(len(nominal) - 1)))
    panels = figure.subplots(1, len(names))
    for k, (ax, name) in enumerate(zip(panels, names, strict=True)):
        for part, colour in zip(assessment.signals, SERIES_COLOURS, strict=False):
            percent = 100 * (part.gains[:, k] / nominal[k] - 1)
            ax.plot(*thinned(part.time, percent, 800), color=colour, label=part.axis)
        ax.set_title(f"${name}$")
        ax.set_xlabel("time (s)")
    panels[0].set_ylabel("change (%)")
    legend_above(figure, panels[0].get_legend_handles_labels()[0])
    return figure


@styled()
def mismatch_figure(
    near: InertiaMismatch, far: InertiaMismatch, certificates: Sequence[StabilityCertificate]
) -> CaptionedFigure:
    """Mismatch met over postures beside what certificates of growing boxes tolerate (%)."""
    figure = new_figure(
        2.5,
        "Inertia mismatch $\\|M_x^{-1}\\hat M_x - 1\\|$ on the force axes: share of postures "
        f"below each value, checked on {len(near.norms)} postures around home and "
        f"{len(far.norms)} across the workspace; dashed, what is proved to be tolerated when the "
        "gains may move within the box written beside it.",
    )
    ax = figure.subplots()
    for found, colour, label in (
        (near, COLOURS["adaptive"], "around home"),
        (far, COLOURS["heart"], "across the workspace"),
    ):
        ordered = np.sort(found.norms)
        below = np.arange(1, ordered.size + 1) / ordered.size
        ax.step(
            100 * np.concatenate([[0.0], ordered]),
            100 * np.concatenate([[0.0], below]),
            where="post",
            color=colour,
            label=label,
        )
    for certificate in certificates:
        tolerated = 100 * certificate.tolerated_mismatch
        share = 100 * to_float(certificate.box.upper[0] / certificate.loop.scaled_gains[0] - 1)
        ax.axvline(tolerated, color=COLOURS["limit"], linestyle=_DASHED, linewidth=0.9)
        ax.annotate(
            f"±{share:.3g} %",
            (tolerated, 104),
            ha="center",
            annotation_clip=False,
            color=COLOURS["limit"],
        )
    ax.set_xlim(0, None)
    ax.set_ylim(0, 103)
    ax.set_xlabel("mismatch (%)")
    ax.set_ylabel("postures below (%)")
    legend_above(figure, ax.get_legend_handles_labels()[0])
    return figure


@styled()
def advice_figure(
    design: RSTDesign, predictions: Sequence[Prediction], noise_growth: float
) -> CaptionedFigure:
    """Delay margin (ms) and force noise over the frozen loop's against the adaptation speed."""
    figure = new_figure(
        2.7,
        "What the adaptation speed $\\lambda = \\hat\\gamma\\omega|\\hat\\varphi_0|^2$ costs. Left:"
        " delay margin from the linearised loop; triangles are simulations, pointing down where "
        "the kick dies out and up where it grows (the frozen loop's stand at the left edge). "
        "Right: force noise over that of the frozen loop; dashed, the growth accepted.",
    )
    delay, noise = figure.subplots(1, 2)
    speeds = np.geomspace(10, 1e5, 41)
    margins = [AdaptationLoop(design=design, speed=v).margins().delay_margin for v in speeds]
    gains = np.array([AdaptationLoop(design=design, speed=v).noise_gain() for v in speeds])
    frozen = AdaptationLoop(design=design, speed=0.0).noise_gain()
    delay.semilogx(speeds, 1e3 * np.array(margins), color=COLOURS["adaptive"])
    noise.semilogx(speeds, gains / frozen, color=COLOURS["adaptive"])
    noise.axhline(noise_growth, color=COLOURS["limit"], linestyle=_DASHED)
    for item, speed in zip(predictions, _prediction_speeds(predictions, speeds), strict=True):
        for value, growth in (
            (item.inside, item.inside_growth),
            (item.outside, item.outside_growth),
        ):
            calm = growth < 0
            colour = COLOURS["adaptive_inverse"] if calm else COLOURS["frozen"]
            delay.plot(speed, 1e3 * value, "v" if calm else "^", color=colour, markersize=5)
    delay.set_ylim(0, None)
    for ax in (delay, noise):
        ax.set_xlabel("$\\lambda$ (1/s)")
    delay.set_ylabel("delay margin (ms)")
    noise.set_ylabel("force noise / frozen (–)")
    return figure


def _prediction_speeds(predictions: Sequence[Prediction], speeds: FloatArray) -> list[float]:
    """Abscissa of each prediction; the frozen loop stands at the left edge of the log axis."""
    return [max(item.speed, float(speeds[0])) for item in predictions]
