"""What a comparison says, from its numbers: rankings, the front, what adaptation buys, claims."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mrac_design.comparison.comparison import Comparison
from mrac_design.comparison.contestant import Contestant, Family
from mrac_design.comparison.judging import Measured, interval_half_width

CERTIFIED_TARGET = 8e-3
"""Largest rms force error the best certified controller may have (N)."""
LIMIT_FACTOR = 1.5
"""By how much it may exceed the limit of linear control."""

PAIRS = (
    ("mrac", "frozen"),
    ("mrac_inverse", "frozen_inverse"),
    ("mrac_bias", "integral"),
    ("mrac_resonant", "resonant"),
    ("mrac_harmonic", "resonant"),
)
"""Adaptive contestants with the fixed ones they are to be measured against: the same reference
path and internal model, and for the bias regressor, which integrates, the fixed controller that
integrates too."""


def ranking(comparison: Comparison, condition: str) -> tuple[Contestant, ...]:
    """Contestants by mean rms force error under a condition, the best first."""

    def error(contestant: Contestant) -> float:
        measured = measured_under(comparison, contestant.name, condition)
        return float("inf") if measured.lost else measured.mean

    return tuple(sorted(comparison.contestants, key=error))


def measured_under(comparison: Comparison, name: str, condition: str) -> Measured:
    """What was measured of a contestant under a condition."""
    return comparison.entries[name].judgement.conditions[condition]


def pareto_front(comparison: Comparison) -> tuple[Contestant, ...]:
    """Contestants none of the others beats in both motion error and noise amplification, by
    rising amplification."""
    points = {
        contestant.name: (
            comparison.entries[contestant.name].judgement.amplification,
            comparison.entries[contestant.name].judgement.motion_error,
        )
        for contestant in comparison.contestants
    }

    def beaten(name: str) -> bool:
        own = points[name]
        return any(
            other[0] <= own[0] and other[1] <= own[1] and other != own for other in points.values()
        )

    unbeaten = [
        contestant
        for contestant in comparison.contestants
        if np.isfinite(points[contestant.name]).all() and not beaten(contestant.name)
    ]
    return tuple(sorted(unbeaten, key=lambda contestant: points[contestant.name]))


def certified(comparison: Comparison) -> tuple[Contestant, ...]:
    """Adaptive contestants whose tuning has its proof and keeps the rule on dead time."""
    return tuple(
        contestant
        for contestant in comparison.contestants
        if contestant.proof is not None and comparison.entries[contestant.name].tuning.admissible
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Mean difference of two contestants' rms errors under the same draws of noise."""

    condition: str
    """Under which condition."""
    mean: float
    """First less second (N)."""
    half_width: float
    """Half width of its interval (N)."""
    relative: float
    """The mean over the second's error."""

    @property
    def decided(self) -> bool:
        """Whether the interval leaves out zero."""
        return abs(self.mean) > self.half_width


def difference(comparison: Comparison, first: str, second: str, condition: str) -> Difference:
    """How much `first` exceeds `second`; the noise is the same for both, run by run."""
    one = measured_under(comparison, first, condition)
    other = measured_under(comparison, second, condition)
    if one.lost or other.lost:
        gap = float(one.lost) - float(other.lost)
        infinite = float("inf") * gap if gap else 0.0
        return Difference(condition=condition, mean=infinite, half_width=0.0, relative=infinite)
    gaps = one.rms - other.rms
    return Difference(
        condition=condition,
        mean=float(gaps.mean()),
        half_width=interval_half_width(gaps),
        relative=float(gaps.mean()) / other.mean,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A sentence with the number that decides it."""

    text: str
    """What is claimed, Markdown."""
    value: str
    """What was found."""
    bound: str
    """What it had to be."""
    met: bool
    """Whether it was."""


def claims(comparison: Comparison) -> tuple[Claim, ...]:
    """The claims this comparison decides."""
    return (*_certified_claims(comparison), _front_claim(comparison), _limit_claim(comparison))


def _certified_claims(comparison: Comparison) -> Sequence[Claim]:
    proved = certified(comparison)
    if not proved:
        missing = Claim(
            text="a certified adaptive controller was found", value="none", bound="one", met=False
        )
        return [missing]
    result = []
    for condition in comparison.conditions.judged[:2]:
        best = next(c for c in ranking(comparison, condition.name) if c in proved)
        measured = measured_under(comparison, best.name, condition.name)
        ceiling = measured.mean + measured.half_width
        limit = comparison.limits[condition.name].error
        ratio = measured.mean / limit
        where = condition.title
        result += [
            Claim(
                text=f"best certified ({best.title}), rms force error, {where}",
                value=f"{1e3 * measured.mean:.2f} ± {1e3 * measured.half_width:.2f} mN",
                bound=f"{1e3 * CERTIFIED_TARGET:g} mN",
                met=not measured.lost and ceiling <= CERTIFIED_TARGET,
            ),
            Claim(
                text=f"the same over the limit of linear control, {where}",
                value=f"{ratio:.2f}",
                bound=f"{LIMIT_FACTOR:g}",
                met=not measured.lost and ratio <= LIMIT_FACTOR,
            ),
        ]
    return result


def _front_claim(comparison: Comparison) -> Claim:
    front = pareto_front(comparison)
    ours = [contestant.title for contestant in front if contestant.family is Family.ADAPTIVE]
    return Claim(
        text="an adaptive RST controller lies on the front of motion error and amplification",
        value=", ".join(ours) or "none does",
        bound="one",
        met=bool(ours),
    )


def _limit_claim(comparison: Comparison) -> Claim:
    """Linear contestants under the very motion the limit is computed for."""
    limit = comparison.limits["random"].error
    linear = [c for c in comparison.contestants if c.features.linear]
    best = min(linear, key=lambda c: measured_under(comparison, c.name, "random").mean)
    measured = measured_under(comparison, best.name, "random")
    return Claim(
        text=f"no linear contestant is below the limit on its own motion (nearest: {best.title})",
        value=f"{1e3 * measured.mean:.2f} mN",
        bound=f"at least {1e3 * limit:.2f} mN",
        met=measured.mean + measured.half_width >= limit,
    )


def findings(comparison: Comparison) -> tuple[str, ...]:
    """The comparison in sentences, Markdown, every one of them computed."""
    return (
        *(_winner(comparison, c.name, c.title) for c in comparison.conditions.judged[:2]),
        _strangers(comparison),
        _front(comparison),
        *(_bought(comparison, first, second) for first, second in PAIRS),
        _noise(comparison),
    )


def _winner(comparison: Comparison, condition: str, title: str) -> str:
    order = ranking(comparison, condition)
    best = order[0]
    measured = measured_under(comparison, best.name, condition)
    level = [
        other.title
        for other in order[1:]
        if not difference(comparison, other.name, best.name, condition).decided
    ]
    ours = next((c for c in order if c.family is Family.ADAPTIVE), None)
    text = (
        f"**{_capital(title)}: {best.title} has the smallest error**, "
        f"{_interval(measured)}, {measured.mean / comparison.limits[condition].error:.2f} times "
        "the limit of linear control."
    )
    if level:
        text += f" Not told apart from it by the noise: {', '.join(level)}."
    if ours is not None and ours is not best:
        own = measured_under(comparison, ours.name, condition)
        text += (
            f" The best adaptive controller, {ours.title}, comes in place "
            f"{order.index(ours) + 1} of {len(order)} with {_interval(own)}, "
            f"{100 * (own.mean / measured.mean - 1):.0f} % above."
        )
    return text


def _strangers(comparison: Comparison) -> str:
    names = [c.name for c in comparison.conditions.judged[2:]]
    titles = {name: _short(name) for name in names}
    firsts = {name: ranking(comparison, name)[0] for name in names}
    text = "On motions nobody was tuned on, the smallest error is "
    winners = dict.fromkeys(winner.title for winner in firsts.values())
    text += "; ".join(
        f"that of {winner} ({', '.join(titles[n] for n in names if firsts[n].title == winner)})"
        for winner in winners
    )
    lost = {
        contestant.title: [
            titles[n] for n in names if measured_under(comparison, contestant.name, n).lost
        ]
        for contestant in comparison.contestants
    }
    losers = [f"{title} ({', '.join(where)})" for title, where in lost.items() if where]
    return text + (
        f". Lost control: {'; '.join(losers)}." if losers else ". No contestant lost control."
    )


def _front(comparison: Comparison) -> str:
    front = pareto_front(comparison)
    ours = [c.title for c in front if c.family is Family.ADAPTIVE]
    text = (
        "On the front of motion error against noise amplification, where nobody is better in "
        f"both, lie {', '.join(c.title for c in front)}."
    )
    if ours:
        return text + f" Adaptive among them: {', '.join(ours)}."
    nearest = min(
        (c for c in comparison.contestants if c.family is Family.ADAPTIVE),
        key=lambda c: comparison.entries[c.name].judgement.motion_error,
        default=None,
    )
    if nearest is None:
        return text
    own = comparison.entries[nearest.name].judgement
    better = [
        c
        for c in front
        if comparison.entries[c.name].judgement.amplification <= own.amplification
        and comparison.entries[c.name].judgement.motion_error <= own.motion_error
    ]
    rival = comparison.entries[better[0].name].judgement
    return text + (
        f" **No adaptive controller is among them**: {nearest.title} leaves "
        f"{1e3 * own.motion_error:.2f} mN at an amplification of {own.amplification:.2f}, "
        f"{better[0].title} {1e3 * rival.motion_error:.2f} mN at {rival.amplification:.2f}."
    )


def _bought(comparison: Comparison, adaptive: str, fixed: str) -> str:
    titles = {c.name: c.title for c in comparison.contestants}
    if adaptive not in titles or fixed not in titles:
        return f"{adaptive} and {fixed} did not both take part."
    buys: list[str] = []
    nothing: list[str] = []
    costs: list[str] = []
    for condition in comparison.conditions.judged:
        gap = difference(comparison, adaptive, fixed, condition.name)
        shown = f"{_short(condition.name)} ({100 * gap.relative:+.0f} %)"
        group = nothing if not gap.decided else buys if gap.mean < 0 else costs
        group.append(shown)
    parts = [
        f"{word} under {', '.join(group)}"
        for word, group in (("gains", buys), ("gains nothing", nothing), ("costs", costs))
        if group
    ]
    return f"Adaptation, **{titles[adaptive]} over {titles[fixed]}**, {'; '.join(parts)}."


def _noise(comparison: Comparison) -> str:
    first = comparison.conditions.judged[0].name
    limit = comparison.limits[first]
    share = (limit.amplification * limit.noise / limit.error) ** 2
    return (
        f"Of the limit's square, {100 * share:.0f} % is sensor noise that no linear controller "
        "can both use and ignore: a better sensor would lower that floor first."
    )


def _short(condition: str) -> str:
    return f"“{condition.replace('_', ' ')}”"


def _interval(measured: Measured) -> str:
    return f"{1e3 * measured.mean:.2f} ± {1e3 * measured.half_width:.2f} mN rms"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
