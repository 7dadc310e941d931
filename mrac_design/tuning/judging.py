"""A tuned choice looked at from outside: motions it never saw, half the step, its neighbours."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.errors import ParameterError
from mrac_design.motion import available_motions
from mrac_design.simulation.scenario import MotionChoice, Scenario
from mrac_design.study import scenario_motion
from mrac_design.tuning.tuner import Point, TuningRecord, as_given, evaluate
from mrac_design.tuning.variables import VARIABLES, Variable

Progress = Callable[[str, float], None]
"""Called with what is being done and the finished share, 0 to 1."""

PARAMETRIC = "parametric"
"""The packaged motion that no recording enters."""
_UNSEEN_SHARE = 0.4
"""Share of the judging that unseen motions take."""

_GAINS = 7
"""Values of γ̂ on a curve of the trade-off."""
_REACH = 10.0
"""How far below the smaller of start and tuned γ̂ the curves begin."""
_NEAR_LIMIT = 0.98
"""Share of the fastest adaptation that can be integrated at which the curves end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Unseen:
    """The scenarios on a motion the tuner never saw."""

    motion: str
    """Name of the motion."""
    start: Point
    """Every scenario with its own values."""
    tuned: Point
    """Every scenario with the tuned values."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """Error and delay margin over γ̂, everything else held."""

    k2: float
    """K2 (1/s)."""
    tuned: bool
    """Whether ao and α are the tuned ones; else they are those of the start."""
    gains: FloatArray
    """γ̂, shape (N,)."""
    errors: FloatArray
    """Largest error over scenarios and axes (%), (N,); inf where a run was lost."""
    margins: FloatArray
    """Least delay margin of the scenarios (s), (N,)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judgement:
    """What is known of a tuned choice beyond what the search saw."""

    unseen: tuple[Unseen, ...]
    """Motions it was not tuned on."""
    step_effect: float | None
    """Largest change of an error (percentage points) with half the step; None: not judged."""
    curves: tuple[Curve, ...]
    """The trade-off around it."""


UNJUDGED = Judgement(unseen=(), step_effect=None, curves=())
"""Nothing beyond the search."""


def unseen_motions(scenario: Scenario, named: Sequence[str]) -> tuple[MotionChoice, ...]:
    """Motions from names of packaged ones, files, or points of the recording tuned on.

    `scenario` has the motion tuned on; without names the parametric model is taken, if that is
    another one. Raises ParameterError for the motion tuned on and for a point when it is no
    recording, and what reading a motion raises.
    """
    own = scenario.motion
    packaged = own.source in available_motions() or Path(own.source).suffix == ".toml"
    chosen = []
    for name in named or [PARAMETRIC] * (own.source != PARAMETRIC):
        if name in available_motions() or Path(name).suffix:
            motion = replace(own, source=name)
        elif packaged:
            known = ", ".join(available_motions())
            raise ParameterError(
                "unseen motion", name, f"is none of {known}; a point needs a recording to tune on"
            )
        else:
            motion = replace(own, point=name)
        if motion == own:
            raise ParameterError("unseen motion", name, "is the one tuned on")
        scenario_motion(replace(scenario, motion=motion))
        chosen.append(motion)
    return tuple(chosen)


def judge(record: TuningRecord, motions: Sequence[MotionChoice], progress: Progress) -> Judgement:
    """Start and tuned choice on `motions`, with half the step, and the trade-off around them."""
    unseen = []
    for number, motion in enumerate(motions):
        progress("unseen motions", _UNSEEN_SHARE * number / len(motions))
        unseen.append(_judge_unseen(record, motion))
    effect = _step_effect(record)
    curves = _trade_off(
        record,
        lambda share: progress("trade-off", _UNSEEN_SHARE + (1 - _UNSEEN_SHARE) * share),
    )
    return Judgement(unseen=tuple(unseen), step_effect=effect, curves=curves)


def _judge_unseen(record: TuningRecord, motion: MotionChoice) -> Unseen:
    cases = [case.with_scenario(replace(case.scenario, motion=motion)) for case in record.cases]
    return Unseen(
        motion=scenario_motion(cases[0].scenario).name,
        start=as_given(cases, record.choice.variables),
        tuned=evaluate(cases, record.choice.variables, record.tuned.values),
    )


def _step_effect(record: TuningRecord) -> float:
    """Largest change of an error (percentage points) when the tuned runs take half the step."""
    finer = [
        case.with_scenario(
            replace(
                case.scenario,
                simulation=replace(
                    case.scenario.simulation, step=case.scenario.simulation.step / 2
                ),
            )
        )
        for case in record.cases
    ]
    point = evaluate(finer, record.choice.variables, record.tuned.values)
    return max(
        abs(there.errors[axis] - here.errors[axis])
        for here, there in zip(record.tuned.cases, point.cases, strict=True)
        for axis in here.errors
    )


def _trade_off(record: TuningRecord, progress: Callable[[float], None]) -> tuple[Curve, ...]:
    """Errors and margins over γ̂ for some K2, with ao and α of the start and as tuned."""
    choice, first = record.choice, record.choice.scenarios[0]
    k2, gain = VARIABLES["k2"], VARIABLES["gain"]
    others = tuple(v for v in choice.variables if v.name not in (k2.name, gain.name))
    tuned = dict(zip((v.name for v in choice.variables), record.tuned.values, strict=True))
    held = {
        True: tuple(tuned[v.name] for v in others),
        False: tuple(v.read(first) for v in others),
    }
    kinds = [True] if held[True] == held[False] else [True, False]
    gains = _gains(record, gain.read(first), tuned.get(gain.name, gain.read(first)))
    own = k2.read(first)
    speeds = sorted({0.0, tuned.get(k2.name, own), own, 2 * own})
    curves = []
    for number, (kind, value) in enumerate((kind, value) for kind in kinds for value in speeds):
        points = [
            evaluate(record.cases, (k2, gain, *others), (value, float(g), *held[kind]))
            for g in gains
        ]
        curves.append(
            Curve(
                k2=value,
                tuned=kind,
                gains=readonly(gains),
                errors=readonly([point.worst for point in points]),
                margins=readonly([point.delay_margin for point in points]),
            )
        )
        progress((number + 1) / (len(kinds) * len(speeds)))
    return tuple(curves)


def _gains(record: TuningRecord, own: float, tuned: float) -> FloatArray:
    """γ̂ from well below both to the fastest that can be integrated."""
    chosen = max(own, tuned)
    share = max(record.start.speed_share, record.tuned.speed_share)
    last = chosen * _NEAR_LIMIT / share if 0 < share < 1 else chosen
    if math.isclose(chosen, 0.0):
        return np.zeros(1)
    first = (min(own, tuned) or chosen) / _REACH
    return np.geomspace(first, last, _GAINS)


def variable_text(variables: Sequence[Variable], values: Sequence[float]) -> str:
    """The values for people: "K2 = 0 1/s, γ̂ = 3.01"."""
    return ", ".join(
        f"{v.symbol} = {value:g} {v.unit}".strip()
        for v, value in zip(variables, values, strict=True)
    )
