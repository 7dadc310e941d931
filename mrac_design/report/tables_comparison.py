"""Tables of a comparison: who needs what, who reached what, and how they were tuned."""

from __future__ import annotations

from collections.abc import Callable

from mrac_design.comparison.comparison import Comparison
from mrac_design.comparison.contestant import Contestant
from mrac_design.comparison.findings import claims, measured_under, ranking
from mrac_design.comparison.judging import CONFIDENCE, Measured
from mrac_design.comparison.limit import ASSUMPTIONS
from mrac_design.report.tables import Table

SHORT = {
    "held_back": "held back",
    "stiffer": "stiffer",
    "regular": "regular",
    "fast": "fast",
    "irregular": "irregular",
    "ectopic": "ectopic",
    "apnoea": "apnoea",
    "random": "random",
}
"""Titles of the conditions where a column is narrow."""


def feature_table(comparison: Comparison) -> Table:
    """What every law needs and offers, with its error on the held-back motion."""
    first = comparison.conditions.judged[0].name
    return Table(
        caption=(
            "Table I of [Z] with numbers: what each law needs, whether its gains adapt to the "
            "tissue, what is proved of its loop, and its rms force error (mN) on the held-back "
            f"motion, mean over {comparison.specification.seeds} draws of the sensor's noise with "
            f"the {100 * CONFIDENCE:.0f} % interval. The best comes first."
        ),
        header=("controller", "motion model", "periodic", "ECG", "adapts", "proof", "rms, mN"),
        rows=tuple(
            (
                contestant.title,
                _mark(contestant.features.motion_model),
                _mark(contestant.features.periodicity),
                _mark(contestant.features.ecg),
                _mark(contestant.features.adapts),
                _proof(comparison, contestant),
                _interval(measured_under(comparison, contestant.name, first)),
            )
            for contestant in ranking(comparison, first)
        ),
        numeric=(6,),
    )


def rms_table(comparison: Comparison) -> Table:
    """Mean rms force error (mN) of every contestant under every condition."""
    limits = tuple(
        f"{1e3 * comparison.limits[c.name].error:.2f}" for c in comparison.conditions.judged
    )
    return _condition_table(
        comparison,
        "Mean rms force error in mN; the last row is the limit of linear control. A dash: control "
        "was lost.",
        lambda measured: f"{1e3 * measured.mean:.2f}",
        ("*limit*", *limits),
    )


def largest_table(comparison: Comparison) -> Table:
    """Largest force error (mN) of every contestant under every condition."""
    return _condition_table(
        comparison,
        "Largest force error in mN over all draws of the noise. A dash: control was lost.",
        lambda measured: f"{1e3 * measured.worst:.0f}",
    )


def _condition_table(
    comparison: Comparison,
    caption: str,
    cell: Callable[[Measured], str],
    *further: tuple[str, ...],
) -> Table:
    conditions = comparison.conditions.judged
    first = conditions[0].name
    rows = [
        (
            contestant.title,
            *(
                "–" if measured.lost else cell(measured)
                for condition in conditions
                for measured in (measured_under(comparison, contestant.name, condition.name),)
            ),
        )
        for contestant in ranking(comparison, first)
    ]
    return Table(
        caption=caption,
        header=("controller", *(SHORT.get(c.name, c.name) for c in conditions)),
        rows=(*rows, *further),
        numeric=tuple(range(1, len(conditions) + 1)),
    )


def condition_table(comparison: Comparison) -> Table:
    """What the conditions are."""
    return Table(
        caption="What contestants are tuned and judged on.",
        header=("condition", "what it is", "peak to peak, mm", "judged from, s", "to, s"),
        rows=tuple(
            (
                SHORT.get(c.name, c.name),
                c.title,
                f"{1e3 * float(c.heart.peak_to_peak()[0]):.1f}",
                f"{c.settling:g}",
                f"{c.duration:.4g}",
            )
            for c in (comparison.conditions.training, *comparison.conditions.judged)
        ),
        numeric=(2, 3, 4),
    )


def tuning_table(comparison: Comparison) -> Table:
    """What the tuner chose."""
    rows = []
    for contestant in comparison.contestants:
        tuning = comparison.entries[contestant.name].tuning
        chosen = ", ".join(
            f"{parameter.name} = {value:.3g} {parameter.unit}".rstrip()
            for parameter, value in zip(contestant.parameters, tuning.values, strict=True)
        )
        rows.append(
            (
                contestant.title,
                chosen,
                f"{1e3 * tuning.error:.2f}",
                f"{1e3 * tuning.delayed_error:.2f}",
                "yes" if tuning.admissible else "**no**",
            )
        )
    setting = comparison.specification.setting
    return Table(
        caption=(
            f"Tunings after {comparison.specification.budget} evaluations each: rms force error "
            f"(mN) on the training motion, the same with {setting.extra_delay} more sample(s) of "
            f"dead time, and whether the rule (at most × {setting.allowed_growth:g}, and the "
            "proof where one is claimed) is kept."
        ),
        header=("controller", "tuning", "rms", "delayed", "admissible"),
        rows=tuple(rows),
        numeric=(2, 3),
    )


def claim_table(comparison: Comparison) -> Table:
    """Claims and what this comparison says."""
    return Table(
        caption="Claims, decided by this comparison's numbers.",
        header=("claim", "found", "wanted", "met"),
        rows=tuple(
            (claim.text, claim.value, claim.bound, "yes" if claim.met else "**no**")
            for claim in claims(comparison)
        ),
    )


def limit_assumptions() -> str:
    """Assumptions of the limit as a Markdown list."""
    return "\n".join(f"- {sentence}" for sentence in ASSUMPTIONS)


def _proof(comparison: Comparison, contestant: Contestant) -> str:
    text = contestant.features.proof
    if contestant.proof is None:
        return text
    return text if comparison.entries[contestant.name].tuning.proved else "not found"


def _mark(value: bool) -> str:
    return "yes" if value else "no"


def _interval(measured: Measured) -> str:
    if measured.lost:
        return "lost"
    return f"{1e3 * measured.mean:.2f} ± {1e3 * measured.half_width:.2f}"
