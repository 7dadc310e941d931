"""One tuner for all: the same search, the same number of evaluations, the same objective.

Adaptive laws are tuned in two stages, the controller they adapt first, since a search in all
directions at once would spend the budget before it has a loop worth adapting.

Minimised is the rms force error over the training motion. A tuning is admissible when, with
`extra_delay` samples more dead time than it was designed for, that error grows by no more than
`allowed_growth`: simulated, so the rule is the same for linear and adaptive laws. Beyond it ten
times the excess is added to the objective. A contestant that claims a proof must have it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.comparison.bench import Bench, Sensing, root_mean_square
from mrac_design.comparison.contestant import Contestant
from mrac_design.comparison.setting import Condition
from mrac_design.errors import MracDesignError, ParameterError

GLOBAL_SHARE = 0.55
"""Share of the budget that goes to the global search; a simplex refines the best with the rest."""
BASE_SHARE = 0.75
"""Share after which the parameters beyond a contestant's base move as well."""
POPULATION = 12
"""Members of the global search, whatever the number of parameters."""
FEWEST = 4
"""Smallest budget."""
WORST = 10.0
"""Error that stands for a loop that diverges (N)."""
EXCESS_WEIGHT = 10.0
"""Cost of breaking the rule on dead time: well above what the error can gain by it."""
NOISE_SEED = 0
"""Seed of the sensor noise while tuning; judging uses others."""

Progress = Callable[[float], None]
"""Called with the finished share, 0 to 1."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tuning:
    """What the tuner found for one contestant."""

    values: FloatArray
    """Tuning vector, in the contestant's order."""
    error: float
    """Training error (N rms)."""
    delayed_error: float
    """The same with the extra dead time (N rms)."""
    proved: bool
    """Whether the proof the contestant claims was found; true when it claims none."""
    admissible: bool
    """Whether it keeps the rule on dead time and has its proof."""
    evaluations: int
    """Tuning vectors tried."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", readonly(self.values, (-1,)))


def tune(
    contestant: Contestant,
    bench: Bench,
    training: Condition,
    *,
    budget: int,
    seed: int,
    progress: Progress | None = None,
) -> Tuning:
    """The best tuning of `contestant` that `budget` evaluations find, at least FEWEST."""
    if budget < FEWEST:
        raise ParameterError("budget", budget, f"must be at least {FEWEST} evaluations")
    search = _Search(contestant, bench, training, budget, progress)
    try:
        _global_search(search, round(GLOBAL_SHARE * budget), seed)
        size = len(contestant.parameters)
        if contestant.base < size:
            _simplex(search, contestant.base, round(BASE_SHARE * budget))
        while True:  # a simplex that has contracted starts anew from the best
            _simplex(search, size, budget)
    except _BudgetSpent:
        return search.best


def _global_search(search: _Search, count: int, seed: int) -> None:
    from scipy.optimize import differential_evolution
    from scipy.stats import qmc

    start = search.contestant.position(search.contestant.start)
    size = search.contestant.base
    members = max(5, min(POPULATION, count // 2))
    first = qmc.Sobol(size, seed=seed).random(1 << math.ceil(math.log2(members)))[:members]
    first[0] = start[:size]
    differential_evolution(
        lambda position: search(np.append(position, start[size:])),
        [(0.0, 1.0)] * size,
        init=first,
        maxiter=max(0, count // members - 1),
        rng=seed,
        polish=False,
        tol=0.0,
    )


def _simplex(search: _Search, size: int, until: int) -> None:
    """A simplex in the first `size` parameters about the best so far, up to `until` evaluations."""
    from scipy.optimize import minimize

    best = search.contestant.position(search.best.values)
    centre = best[:size]
    corners = np.vstack([centre, centre + _STEP * np.eye(centre.size)])
    # A corner beyond the border goes to the other side.
    corners = np.where(corners > 1.0, corners - 2.0 * _STEP, corners)
    minimize(
        lambda position: search(np.append(position, best[size:])),
        centre,
        method="Nelder-Mead",
        bounds=[(0.0, 1.0)] * centre.size,
        options={
            "initial_simplex": corners,
            "xatol": 1e-3,
            "fatol": 1e-6,
            "maxfev": max(1, until - search.used),
        },
    )


_STEP = 0.06


class _BudgetSpent(Exception):  # noqa: N818  it ends a search, nothing went wrong
    """Every evaluation has been used."""


@dataclass(slots=True)
class _Search:
    """The objective, counting and remembering the best."""

    contestant: Contestant
    bench: Bench
    training: Condition
    budget: int
    progress: Progress | None
    used: int = 0
    best_value: float = math.inf
    _best: Tuning | None = field(default=None)

    @property
    def best(self) -> Tuning:
        """The best so far, with the number of evaluations used."""
        assert self._best is not None
        found = self._best
        return Tuning(
            values=found.values,
            error=found.error,
            delayed_error=found.delayed_error,
            proved=found.proved,
            admissible=found.admissible,
            evaluations=self.used,
        )

    def __call__(self, position: FloatArray) -> float:
        if self.used >= self.budget:
            raise _BudgetSpent
        self.used += 1
        values = self.contestant.values(position)
        error, delayed = self._errors(values)
        allowed = self.bench.setting.allowed_growth * error
        value = error + EXCESS_WEIGHT * max(0.0, delayed - allowed)
        proved = True
        # Proofs are dear, so only what would become the best has to show one.
        if self.contestant.proof is not None and value < self.best_value:
            proved = self._proved(values)
        if not proved:
            value += WORST
        if value < self.best_value:
            self.best_value = value
            self._best = Tuning(
                values=values,
                error=error,
                delayed_error=delayed,
                proved=proved,
                admissible=proved and delayed <= allowed and error < WORST,
                evaluations=self.used,
            )
        if self.progress is not None:
            self.progress(self.used / self.budget)
        return value

    def _errors(self, values: FloatArray) -> tuple[float, float]:
        setting = self.bench.setting
        sensing = Sensing.of(setting, NOISE_SEED)
        try:
            axis = self.contestant.build(setting, self.training.periods, values)
            found = [
                root_mean_square(
                    self.bench.force_error(axis, self.training, sensing, extra_delay=extra)
                )
                for extra in (0, setting.extra_delay)
            ]
        except (MracDesignError, np.linalg.LinAlgError, ValueError):
            # A vector for which there is no controller, or no bounded run, is merely a bad one.
            return WORST, WORST * setting.allowed_growth + WORST
        return min(found[0], WORST), min(found[1], WORST * setting.allowed_growth + WORST)

    def _proved(self, values: FloatArray) -> bool:
        assert self.contestant.proof is not None
        try:
            return self.contestant.proof(self.bench.setting, values)
        except MracDesignError:
            return False
