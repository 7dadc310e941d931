"""The tuner: the least worst force error over scenarios and axes, within stated constraints.

An admissible choice keeps every motor below its torque limit, leaves the delay margin asked for in
every scenario, and adapts slowly enough for the integration to damp it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.errors import ParameterError, TuningError
from mrac_design.simulation.scenario import Scenario
from mrac_design.tuning.bench import LOST, Case, CaseResult, prepare_case
from mrac_design.tuning.limits import LoopLimits
from mrac_design.tuning.search import SearchEnd, least_largest, scattered
from mrac_design.tuning.variables import Variable, placed, position_of, values_at

FEWEST = 2
"""Smallest budget: the scenarios as they are, and one other choice."""
_SCATTERED = 64
"""Points at which the constraints are tried before anything is simulated."""
_BELOW_LIMIT = 1 - 1e-9
"""A saturated motor stands exactly at its limit; only what stays below is within it."""
_MARGIN_WEIGHT = 5.0
"""A tenth of the delay margin counts in the search like half a unit of the errors' logarithm."""
_MOST_ROOM = 5.0
"""Slack beyond which a constraint no longer tells points apart."""

Watch = Callable[[int, float], None]
"""Called with the number of evaluations and the least admissible worst error (%) so far."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TuningChoice:
    """What to tune, for what, and under which constraint."""

    scenarios: tuple[Scenario, ...]
    """Scenarios that share the tuned values; the first one's values are where the search starts."""
    variables: tuple[Variable, ...]
    """What may be chosen; everything else stays as each scenario has it."""
    delay_margin: float
    """Delay margin (s) to be left in every scenario, >= 0."""
    budget: int
    """Evaluations at most, each a run of every scenario."""
    seed: int
    """Seed of the starts that follow the first."""

    def __post_init__(self) -> None:
        names = [scenario.name for scenario in self.scenarios]
        if not names or len(set(names)) < len(names):
            raise ParameterError("scenarios", ", ".join(names), "needs one or more, all different")
        if not self.variables:
            raise ParameterError("free variables", "none", "needs at least one")
        if not 0 <= self.delay_margin < math.inf:
            raise ParameterError("delay margin", self.delay_margin, "must be a time >= 0 s")
        if self.budget < FEWEST:
            raise ParameterError("budget", self.budget, f"must be at least {FEWEST} evaluations")
        if self.seed < 0:
            raise ParameterError("seed", self.seed, "must be 0 or more")
        laws = {scenario.adaptation.law for scenario in self.scenarios}
        if "alpha" in {v.name for v in self.variables} and laws != {"normalised"}:
            raise ParameterError("free variables", "alpha", "only the normalised law has one")


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One choice of the variables and what every scenario makes of it."""

    values: tuple[float, ...]
    """Values of the variables; of the first scenario where the scenarios are as given."""
    cases: tuple[CaseResult, ...]
    """Results in the order of the scenarios."""

    @property
    def worst(self) -> float:
        """Largest error over scenarios and axes (%)."""
        return max(case.worst for case in self.cases)

    @property
    def delay_margin(self) -> float:
        """Least delay margin of the scenarios (s)."""
        return min(case.limits.delay_margin for case in self.cases)

    @property
    def torque_share(self) -> float:
        """Largest torque over its motor's limit."""
        return max(case.torque_share for case in self.cases)

    @property
    def speed_share(self) -> float:
        """Largest share of the fastest adaptation that can be integrated."""
        return max(case.limits.speed_share for case in self.cases)

    def admissible(self, delay_margin: float) -> bool:
        """Whether every constraint holds, with that delay margin (s) asked for."""
        return (
            self.delay_margin >= delay_margin
            and self.torque_share < _BELOW_LIMIT
            and self.speed_share < 1
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TuningRecord:
    """What the tuner found, and everything it tried."""

    choice: TuningChoice
    """What was asked for."""
    cases: tuple[Case, ...]
    """The scenarios, ready to be run with other values."""
    start: Point
    """The scenarios as given."""
    tuned: Point
    """The best admissible choice."""
    tried: tuple[Point, ...]
    """Every choice that was simulated, in order."""
    interrupted: bool
    """Whether the user ended the search before its budget."""

    @property
    def scenarios(self) -> tuple[Scenario, ...]:
        """The scenarios with the tuned values."""
        choice = self.choice
        return tuple(placed(s, choice.variables, self.tuned.values) for s in choice.scenarios)


def tune(choice: TuningChoice, *, watch: Watch | None = None) -> TuningRecord:
    """The best admissible choice the budget finds; an interruption keeps the best so far.

    Raises TuningError when nothing meets the constraints.
    """
    cases = tuple(prepare_case(scenario) for scenario in choice.scenarios)
    search = _Search(choice=choice, cases=cases, watch=watch)
    start = as_given(cases, choice.variables)
    interrupted = False
    try:
        least_largest(search, _starts(search))
    except KeyboardInterrupt:
        if search.best is None:
            raise
        interrupted = True
    if search.best is None:
        raise _nothing_admissible(search)
    return TuningRecord(
        choice=choice,
        cases=cases,
        start=start,
        tuned=search.best,
        tried=tuple(search.simulated),
        interrupted=interrupted,
    )


def evaluate(
    cases: Sequence[Case], variables: Sequence[Variable], values: tuple[float, ...]
) -> Point:
    """Run every case with the variables at `values`."""
    return Point(values=values, cases=tuple(case.result(variables, values) for case in cases))


def as_given(cases: Sequence[Case], variables: Sequence[Variable]) -> Point:
    """Run every case with its own values."""
    own = [tuple(v.read(case.scenario) for v in variables) for case in cases]
    return Point(
        values=own[0],
        cases=tuple(
            case.result(variables, values) for case, values in zip(cases, own, strict=True)
        ),
    )


@dataclass(slots=True, kw_only=True, eq=False)
class _Search:
    """The evaluation the search sees: counts, and remembers what was tried."""

    choice: TuningChoice
    cases: tuple[Case, ...]
    watch: Watch | None
    simulated: list[Point] = field(default_factory=list)
    best: Point | None = None
    _known: dict[tuple[float, ...], Point] = field(default_factory=dict)
    _limits: dict[tuple[float, ...], tuple[LoopLimits, ...]] = field(default_factory=dict)

    def __call__(self, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        values = values_at(self.choice.variables, position)
        if values not in self._known:
            self._known[values] = self._new(values)
        point = self._known[values]
        errors = np.array([error for case in point.cases for error in case.errors.values()])
        return np.log(np.clip(errors, 1e-12, LOST)), self._room(point)

    def limits(self, values: tuple[float, ...]) -> tuple[LoopLimits, ...]:
        """Limits of every scenario, nothing simulated."""
        if values not in self._limits:
            variables = self.choice.variables
            self._limits[values] = tuple(case.limits(variables, values) for case in self.cases)
        return self._limits[values]

    def allowed(self, values: tuple[float, ...]) -> bool:
        """Whether the constraints that need no simulation hold."""
        limits = self.limits(values)
        return (
            min(one.delay_margin for one in limits) >= self.choice.delay_margin
            and max(one.speed_share for one in limits) < 1
        )

    def _new(self, values: tuple[float, ...]) -> Point:
        limits = self.limits(values)
        runs = all(one.speed_share < 1 for one in limits)
        if runs and len(self.simulated) >= self.choice.budget:
            raise SearchEnd
        point = evaluate(self.cases, self.choice.variables, values)
        if runs:
            self.simulated.append(point)
            if point.admissible(self.choice.delay_margin) and (
                self.best is None or point.worst < self.best.worst
            ):
                self.best = point
            if self.watch is not None:
                best = math.inf if self.best is None else self.best.worst
                self.watch(len(self.simulated), best)
        return point

    def _room(self, point: Point) -> FloatArray:
        asked = self.choice.delay_margin
        room = [
            math.inf if asked == 0 else _MARGIN_WEIGHT * (point.delay_margin / asked - 1),
            math.inf if point.speed_share == 0 else -math.log(point.speed_share),
            _BELOW_LIMIT - point.torque_share,
        ]
        return np.clip(room, -_MOST_ROOM, _MOST_ROOM)


def _starts(search: _Search) -> Iterator[FloatArray]:
    """The scenario's own values, then admissible points spread over the ranges."""
    choice = search.choice
    own = position_of(choice.variables, [v.read(choice.scenarios[0]) for v in choice.variables])
    spread = scattered(len(choice.variables), count=_SCATTERED, seed=choice.seed)
    if not any(search.allowed(values_at(choice.variables, point)) for point in (own, *spread)):
        raise _nothing_allowed(search)
    yield own
    for point in spread[2 ** len(choice.variables) :]:
        if search.allowed(values_at(choice.variables, point)):
            yield point


def _nothing_allowed(search: _Search) -> TuningError:
    variables, asked = search.choice.variables, search.choice.delay_margin
    margins = {
        values: min(one.delay_margin for one in limits)
        for values, limits in search._limits.items()
        if max(one.speed_share for one in limits) < 1
    }
    names = ", ".join(scenario.name for scenario in search.choice.scenarios)
    if not margins:
        return TuningError(
            f"the integration step is too long for every choice tried in {names}: shorten "
            "simulation.step in the scenario, or allow smaller values of the gain"
        )
    values = max(margins, key=lambda key: margins[key])
    where = ", ".join(f"{v.symbol} = {x:g}" for v, x in zip(variables, values, strict=True))
    return TuningError(
        f"a delay margin of {1e3 * asked:g} ms cannot be had in {names}: the largest found is "
        f"{1e3 * margins[values]:.3g} ms, at {where}; ask for less, or widen the ranges"
    )


def _nothing_admissible(search: _Search) -> TuningError:
    within = [
        point for point in search.simulated if point.delay_margin >= search.choice.delay_margin
    ]
    least = min((point.torque_share for point in within), default=math.inf)
    asked = f"a delay margin of {1e3 * search.choice.delay_margin:g} ms"
    if not within:
        return TuningError(
            f"none of the {len(search.simulated)} choices tried leaves {asked}: raise the budget"
        )
    if math.isinf(least):
        problems = [case.lost for point in within for case in point.cases if case.lost]
        return TuningError(f"every run with {asked} was lost, the first because {problems[0]}")
    return TuningError(
        f"none of {len(search.simulated)} choices keeps the motors below their torque limits with "
        f"{asked} (the least reached {least:.0%}): raise the budget, widen the ranges, or lower "
        "the forces asked for"
    )
