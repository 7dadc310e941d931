"""A comparison from its specification to its record: tune, judge, set beside the limit."""

from __future__ import annotations

import hashlib
import json
import math
import multiprocessing
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from mrac_design.comparison.bench import Bench
from mrac_design.comparison.conditions import ConditionSet, condition_set
from mrac_design.comparison.contestant import Contestant
from mrac_design.comparison.judging import judge
from mrac_design.comparison.limit import LinearLimit, linear_front, linear_limit, motion_spectrum
from mrac_design.comparison.rival_contestants import rival_contestants
from mrac_design.comparison.rst_contestants import STIFFEST_FACTOR, rst_contestants
from mrac_design.comparison.setting import AxisSetting, Periods
from mrac_design.comparison.store import ComparisonStore, Entry
from mrac_design.comparison.tuning import tune
from mrac_design.design import ReferenceModel
from mrac_design.errors import FileError, ParameterError
from mrac_design.motion import AXES
from mrac_design.simulation.sampling_choices import SampledMeasurement
from mrac_design.simulation.scenario import MotionChoice, Scenario

BUDGET, SEEDS = 160, 8
"""Evaluations a contestant is tuned with, and draws of noise it is judged with, by default."""
FRONT_POINTS = 40
"""Points of the limit's front."""

Progress = Callable[[str, float], None]
"""Called with what has been finished and the share of all work, 0 to 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonSpecification:
    """Everything a comparison depends on."""

    setting: AxisSetting
    """What every contestant faces."""
    motion: MotionChoice
    """The motion they are tuned on."""
    axis: str
    """Which of its axes: X, Y or Z."""
    stiffness_factor: float
    """Stiffness of the stiffer tissue over the design's."""
    budget: int
    """Evaluations each contestant is tuned with."""
    seeds: int
    """Draws of the noise each is judged with."""
    seed: int
    """Seed of the tuner."""
    taking_part: tuple[str, ...]
    """Names of the contestants."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "taking_part", tuple(self.taking_part))
        self.contestants  # noqa: B018  raises for a name nobody has
        if self.axis not in AXES:
            raise ParameterError("axis", self.axis, f"must be one of {', '.join(AXES)}")
        if not 0 < self.stiffness_factor < math.inf:
            raise ParameterError("stiffness factor", self.stiffness_factor, "must be > 0")
        if self.seeds < 2:
            raise ParameterError("seeds", self.seeds, "must be at least 2")

    @property
    def contestants(self) -> tuple[Contestant, ...]:
        """The contestants named, in the order of `contestants`."""
        known = {contestant.name: contestant for contestant in contestants()}
        for name in self.taking_part:
            if name not in known:
                raise ParameterError("contestant", name, f"must be one of {', '.join(known)}")
        if not self.taking_part:
            raise ParameterError("contestants", "none", "needs at least one name")
        return tuple(known[name] for name in known if name in self.taking_part)

    def fingerprint(self, contestant: Contestant) -> str:
        """A hash of everything the result of a contestant depends on."""
        source = Path(self.motion.source)
        content = {
            **{n: v for n, v in specification_values(self).items() if n != "taking_part"},
            "recording": hashlib.sha256(source.read_bytes()).hexdigest()
            if source.is_file()
            else "",
            "parameters": [asdict(parameter) for parameter in contestant.parameters],
            "version": version("mrac-design"),
            "law": _law_hash(contestant, self.setting),
            "method": _method_hash(),
        }
        text = json.dumps(content, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def comparison_specification(
    scenario: Scenario,
    *,
    axis: str = "Z",
    budget: int = BUDGET,
    seeds: int = SEEDS,
    seed: int = 0,
    taking_part: Sequence[str] | None = None,
) -> ComparisonSpecification:
    """The comparison on one axis of a scenario with a sampled controller and a noisy sensor.

    `taking_part` names contestants; without it all take part. Raises ParameterError for a scenario
    in continuous time: noise then means nothing.
    """
    sampling = scenario.sampling
    if not isinstance(sampling, SampledMeasurement):
        raise ParameterError(
            "scenario", scenario.name, "needs a sampled controller, as the scenario 'reality' has"
        )
    factor = scenario.stiffness / scenario.design.stiffness
    return ComparisonSpecification(
        setting=AxisSetting(
            stiffness=scenario.design.stiffness,
            velocity_gain=scenario.design.velocity_gain,
            period=sampling.domain.period,
            delay=sampling.delay,
            noise=sampling.force_sensor.noise,
            resolution=sampling.force_sensor.resolution,
            prefilter=scenario.prefilter,
            extra_delay=1,
            allowed_growth=2.0,
        ),
        motion=scenario.motion,
        axis=axis,
        stiffness_factor=STIFFEST_FACTOR if factor == 1.0 else factor,
        budget=budget,
        seeds=seeds,
        seed=seed,
        taking_part=tuple([c.name for c in contestants()] if taking_part is None else taking_part),
    )


def contestants() -> tuple[Contestant, ...]:
    """All contestants, the paper's controller without adaptation first."""
    return (*rst_contestants(), *rival_contestants())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Comparison:
    """A finished comparison."""

    specification: ComparisonSpecification
    """What it was."""
    conditions: ConditionSet
    """What contestants were run on."""
    entries: Mapping[str, Entry]
    """What is known of each, by name."""
    limits: Mapping[str, LinearLimit]
    """The limit of linear control by condition, from the condition's own spectrum."""
    front: tuple[LinearLimit, ...]
    """The best exchange of motion error against amplification on the first condition."""

    @property
    def contestants(self) -> tuple[Contestant, ...]:
        """Who took part."""
        return self.specification.contestants


def run_comparison(
    specification: ComparisonSpecification,
    *,
    store: ComparisonStore,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Tune and judge every contestant; finished ones are taken from the store.

    `workers` processes run at a time, one a core unless given. Raises MotionFileError for a
    motion that cannot be used.
    """
    conditions = _conditions(specification)  # a motion that cannot be used is told at once
    chosen = specification.contestants
    prints = {contestant.name: specification.fingerprint(contestant) for contestant in chosen}
    entries: dict[str, Entry] = {}
    missing = []
    for contestant in chosen:
        known = store.read(contestant.name, prints[contestant.name])
        if known is None:
            missing.append(contestant)
        else:
            entries[contestant.name] = known
    for contestant, entry in _computed_in_processes(
        specification, missing, workers, len(chosen), progress
    ):
        store.write(contestant.name, prints[contestant.name], entry)
        entries[contestant.name] = entry
    return Comparison(
        specification=specification,
        conditions=conditions,
        entries={contestant.name: entries[contestant.name] for contestant in chosen},
        limits=_limits(specification, conditions),
        front=_front(specification, conditions),
    )


def _conditions(specification: ComparisonSpecification) -> ConditionSet:
    return condition_set(
        specification.setting,
        specification.motion,
        axis=specification.axis,
        stiffness_factor=specification.stiffness_factor,
    )


def compete(
    contestant: Contestant,
    specification: ComparisonSpecification,
    conditions: ConditionSet,
    progress: Callable[[float], None] | None = None,
) -> Entry:
    """Tune and judge one contestant."""
    bench = Bench(setting=specification.setting)
    tuning = tune(
        contestant,
        bench,
        conditions.training,
        budget=specification.budget,
        seed=specification.seed,
        progress=None if progress is None else lambda done: progress(_TUNING_SHARE * done),
    )
    judgement = judge(
        contestant,
        tuning.values,
        bench,
        conditions.judged,
        seeds=specification.seeds,
        progress=None
        if progress is None
        else lambda done: progress(_TUNING_SHARE + (1.0 - _TUNING_SHARE) * done),
    )
    return Entry(tuning=tuning, judgement=judgement)


_TUNING_SHARE = 0.7


def _computed_in_processes(
    specification: ComparisonSpecification,
    missing: Sequence[Contestant],
    workers: int | None,
    total: int,
    progress: Progress | None,
) -> Any:
    """Contestants with their entries as they are finished, in as many processes as given."""
    if not missing:
        return
    count = min(len(missing), workers or len(os.sched_getaffinity(0)))
    context = multiprocessing.get_context("spawn")
    shares = context.Array("d", len(missing))
    done_before = total - len(missing)
    # The largest programs first, so that no core waits for them in the end.
    order = sorted(range(len(missing)), key=lambda i: -len(missing[i].parameters))
    with ProcessPoolExecutor(
        count, mp_context=context, initializer=_start_worker, initargs=(specification, shares)
    ) as pool:
        running: dict[Future[Entry], Contestant] = {
            pool.submit(_work, missing[i], i): missing[i] for i in order
        }
        waiting = set(running)
        latest = "tuning"
        try:
            while waiting:
                finished, waiting = wait(waiting, timeout=0.5, return_when=FIRST_COMPLETED)
                for future in finished:
                    latest = f"finished {running[future].title}"
                    yield running[future], future.result()
                if progress is not None:
                    progress(latest, (done_before + sum(shares[:])) / total)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


_WORKER: dict[str, Any] = {}


def _start_worker(specification: ComparisonSpecification, shares: Any) -> None:
    _WORKER["specification"], _WORKER["shares"] = specification, shares
    _WORKER["conditions"] = _conditions(specification)


def _work(contestant: Contestant, index: int) -> Entry:
    def report(share: float) -> None:
        _WORKER["shares"][index] = share

    return compete(contestant, _WORKER["specification"], _WORKER["conditions"], report)


def _limits(
    specification: ComparisonSpecification, conditions: ConditionSet
) -> Mapping[str, LinearLimit]:
    setting = specification.setting
    limits = {}
    for condition in conditions.judged:
        spectrum = motion_spectrum(
            condition.heart,
            start=condition.settling,
            end=condition.duration,
            period=setting.period,
        )
        limits[condition.name] = linear_limit(
            spectrum, setting, stiffness_factor=condition.stiffness_factor
        )
    # The random motion is drawn from this spectrum, which its own would only approximate.
    limits["random"] = linear_limit(conditions.spectrum, setting)
    return limits


def _front(
    specification: ComparisonSpecification, conditions: ConditionSet
) -> tuple[LinearLimit, ...]:
    first, setting = conditions.judged[0], specification.setting
    spectrum = motion_spectrum(
        first.heart, start=first.settling, end=first.duration, period=setting.period
    )
    noises = setting.sensor_noise * np.geomspace(0.1, 100.0, FRONT_POINTS)
    return linear_front(spectrum, setting, noises=noises)


def specification_values(specification: ComparisonSpecification) -> dict[str, Any]:
    """A specification as plain data."""
    return asdict(specification)


def save_specification(specification: ComparisonSpecification, path: Path) -> None:
    """Write a specification that `load_specification` reads back to an equal one."""
    text = json.dumps(specification_values(specification), indent=2)
    path.write_text(text + "\n", encoding="utf-8")


def load_specification(path: Path) -> ComparisonSpecification:
    """Read a specification; raises FileError for a file that is none."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        setting = content.pop("setting")
        return ComparisonSpecification(
            setting=AxisSetting(**{**setting, "prefilter": ReferenceModel(**setting["prefilter"])}),
            motion=MotionChoice(**content.pop("motion")),
            **content,
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as problem:
        raise FileError(path, "", f"is no specification of a comparison: {problem}") from problem


def _law_hash(contestant: Contestant, setting: AxisSetting) -> str:
    """A hash of the contestant's equations and of its numbers at the start of the search."""
    step = contestant.build(setting, Periods(beat=1.0, breath=5.0), contestant.start).step
    equations = (step.command.serialize() + step.advance.serialize()).encode()
    return hashlib.sha256(equations + step.parameter_values.tobytes()).hexdigest()


def _method_hash() -> str:
    """A hash of the code that tunes and judges: results of other code are not taken for its own."""
    digest = hashlib.sha256()
    for name in _METHOD:
        digest.update((Path(__file__).parent / f"{name}.py").read_bytes())
    return digest.hexdigest()


_METHOD = ("bench", "conditions", "judging", "setting", "tuning")
