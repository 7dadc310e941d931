"""The rivals from the literature, each with what its law leaves to be tuned."""

from __future__ import annotations

from mrac_design.arrays import FloatArray
from mrac_design.comparison.contestant import (
    LEAD,
    Build,
    Contestant,
    Family,
    Features,
    TunedAxis,
    TuningParameter,
)
from mrac_design.comparison.setting import AxisSetting, Periods
from mrac_design.controller.reference import LeadingInverse
from mrac_design.controller.rivals.active_observer import (
    ActiveObserver,
    ObserverTuning,
    active_observer,
)
from mrac_design.controller.rivals.beat_preview import BeatPreview, beat_preview_step
from mrac_design.controller.rivals.harmonics import Rhythm, RhythmObserver
from mrac_design.controller.rivals.learning import IterativeLearning, iterative_learning
from mrac_design.controller.rivals.linear import LinearController, build_linear_step
from mrac_design.controller.rivals.prediction import Horizon
from mrac_design.controller.rivals.predictive import PredictiveControl, predictive_control
from mrac_design.controller.rivals.predictive_observer import (
    PredictiveObserver,
    predictive_observer,
)

LEADS = (10, 20, 40)
"""Leads δ the learning law may choose from (samples): every one is a program of its own."""
_LEARNING_REACH = 100
_BEAT_HARMONICS, _BREATH_HARMONICS = 5, 2
_CHANGE = 0.03  # s
_PREVIEW, _CELL, _LONGEST_BEAT = 8, 0.02, 2.0


def _whole(name: str, low: float, high: float, start: float) -> TuningParameter:
    return TuningParameter(name=name, unit="samples", low=low, high=high, start=start)


TIME_CONSTANT = TuningParameter(name="$\\tau$", unit="s", low=2e-4, high=0.03, start=0.002)
DRIVE = TuningParameter(name="drive", unit="m/s²", low=1e-3, high=20.0, start=0.1)
FIRST_POLE = TuningParameter(name="$1 - p_1$ of $C$", unit="", low=0.005, high=0.95, start=0.1)
SECOND_POLE = TuningParameter(name="$1 - p_2$ of $C$", unit="", low=0.005, high=0.95, start=0.5)
HORIZON = _whole("$N_2$", 4.0, 60.0, 15.0)
MOVES = TuningParameter(name="$N_u$", unit="", low=1.0, high=6.0, start=3.0)
PENALTY = TuningParameter(name="$\\lambda$", unit="(N/(m/s²))²", low=1e-10, high=1e-3, start=1e-8)


def rival_contestants() -> tuple[Contestant, ...]:
    """Learning, observers, predictive laws and preview."""
    horizon = (HORIZON, MOVES, PENALTY)
    return (
        _rival("learning", "PI + iterative learning", _LEARNING, _learning, periodic=True),
        _rival("observer", "active observer, order 1", (TIME_CONSTANT, DRIVE, LEAD), _observer),
        _rival("observer_2", "active observer, order 2", (TIME_CONSTANT, DRIVE, LEAD), _observer_2),
        _rival(
            "observers",
            "two active observers",
            (
                TIME_CONSTANT,
                DRIVE,
                TuningParameter(name="$\\tau_2$", unit="s", low=2e-4, high=0.03, start=0.002),
                TuningParameter(name="drive 2", unit="N", low=1e-5, high=0.1, start=1e-3),
                LEAD,
            ),
            _observers,
        ),
        _rival("predictive", "predictive", (*horizon, FIRST_POLE, SECOND_POLE), _predictive),
        _rival("predictive_observer", "predictive + observer", (*horizon, DRIVE), _with_observer),
        _rival(
            "gpc",
            "GPC + motion predictor",
            (
                *horizon,
                FIRST_POLE,
                SECOND_POLE,
                TuningParameter(name="beat drive", unit="N", low=1e-6, high=0.1, start=1e-4),
                TuningParameter(name="slow drive", unit="m/s²", low=1e-4, high=3.0, start=0.01),
                TuningParameter(name="breath drive", unit="N", low=1e-6, high=0.1, start=1e-4),
            ),
            _gpc,
            periodic=True,
        ),
        Contestant(
            name="preview",
            title="beat preview (ECG)",
            family=Family.RIVAL,
            features=Features(
                motion_model=True,
                periodicity=True,
                ecg=True,
                adapts=False,
                linear=False,
                proof="none",
            ),
            parameters=(
                PENALTY,
                DRIVE,
                TuningParameter(name="learning", unit="", low=0.02, high=1.0, start=0.3),
                TuningParameter(name="lag", unit="s", low=1e-3, high=0.05, start=0.004),
            ),
            base=4,
            build=_preview,
        ),
    )


def _rival(
    name: str,
    title: str,
    parameters: tuple[TuningParameter, ...],
    build: Build,
    *,
    periodic: bool = False,
) -> Contestant:
    return Contestant(
        name=name,
        title=title,
        family=Family.RIVAL,
        features=Features(
            motion_model=True,
            periodicity=periodic,
            ecg=False,
            adapts=False,
            linear=True,
            proof="fixed gains: poles",
        ),
        parameters=parameters,
        base=len(parameters),
        build=build,
    )


def _axis(setting: AxisSetting, controller: LinearController) -> TunedAxis:
    return TunedAxis(step=build_linear_step(controller), velocity_gain=setting.velocity_gain)


_LEARNING = (
    TuningParameter(name="$K_p$", unit="m/(s²·N)", low=0.3, high=100.0, start=10.0),
    TuningParameter(name="$K_i$", unit="m/(s³·N)", low=0.1, high=1000.0, start=50.0),
    TuningParameter(name="$L$", unit="m/(s²·N)", low=0.03, high=50.0, start=1.0),
    TuningParameter(name="$Q$", unit="Hz", low=4.0, high=25.0, start=12.0),
    TuningParameter(name="$\\delta$", unit="samples", low=7.0, high=57.0, start=20.0),
    TuningParameter(name="$K_2$", unit="1/s", low=30.0, high=400.0, start=200.0),
)


def _learning(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    proportional, integral, learning, cutoff, lead, velocity_gain = map(float, values)
    controller = iterative_learning(
        IterativeLearning(
            proportional=proportional,
            integral=integral,
            learning=learning,
            lead=min(LEADS, key=lambda choice: abs(choice / lead - 1.0)),
            repetition=round(periods.beat / setting.period),
            cutoff=cutoff,
            half_width=_LEARNING_REACH,
            prefilter=setting.prefilter,
            time_domain=setting.domain,
        )
    )
    # The law is made for a fast inner velocity loop, so it may choose that loop's gain.
    return TunedAxis(step=build_linear_step(controller), velocity_gain=velocity_gain)


def _tuning(setting: AxisSetting, order: int, time_constant: float, drive: float) -> ObserverTuning:
    return ObserverTuning(
        order=order,
        time_constant=time_constant,
        drive=drive,
        input_noise=0.0,
        force_noise=setting.sensor_noise,
    )


def _active(
    setting: AxisSetting,
    force_loop: ObserverTuning,
    motion_loop: ObserverTuning | None,
    lead: float,
) -> TunedAxis:
    controller = active_observer(
        ActiveObserver(
            plant=setting.plant,
            force_loop=force_loop,
            motion_loop=motion_loop,
            prefilter=setting.prefilter,
            feedforward=LeadingInverse(lead),
            time_domain=setting.domain,
            delay=setting.delay,
        )
    )
    return _axis(setting, controller)


def _observer(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    return _active(
        setting, _tuning(setting, 1, float(values[0]), float(values[1])), None, float(values[2])
    )


def _observer_2(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    # The second difference of a smooth motion is smaller than the first by about the time
    # over which it changes, so one range of drives serves both orders.
    drive = float(values[1]) * setting.period / _CHANGE
    return _active(setting, _tuning(setting, 2, float(values[0]), drive), None, float(values[2]))


def _observers(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    inner = _tuning(setting, 1, float(values[0]), float(values[1]))
    outer = _tuning(setting, 1, float(values[2]), float(values[3]))
    return _active(setting, inner, outer, float(values[4]))


def _horizon(first: int, last: float, moves: float, penalty: float) -> Horizon:
    end = max(first, round(last))
    return Horizon(first=first, last=end, moves=min(round(moves), end), penalty=penalty)


def _receding(
    setting: AxisSetting, values: FloatArray, rhythms: RhythmObserver | None
) -> TunedAxis:
    controller = predictive_control(
        PredictiveControl(
            plant=setting.plant,
            horizon=_horizon(1 + setting.delay, *map(float, values[:3])),
            observer_poles=(1.0 - float(values[3]), 1.0 - float(values[4])),
            breath=None,
            rhythms=rhythms,
            prefilter=setting.prefilter,
            time_domain=setting.domain,
            delay=setting.delay,
        )
    )
    return _axis(setting, controller)


def _predictive(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    return _receding(setting, values, None)


def _gpc(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    drives = float(values[5]), float(values[7])
    beat = Rhythm(frequency=1.0 / periods.beat, harmonics=_BEAT_HARMONICS, drive=drives[0])
    breath = Rhythm(frequency=1.0 / periods.breath, harmonics=_BREATH_HARMONICS, drive=drives[1])
    observer = RhythmObserver(
        rhythms=(beat, breath),
        slow_drive=float(values[6]),
        force_noise=setting.sensor_noise,
    )
    return _receding(setting, values, observer)


def _with_observer(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    controller = predictive_observer(
        PredictiveObserver(
            plant=setting.plant,
            horizon=_horizon(1, *map(float, values[:3])),
            order=1,
            drive=float(values[3]),
            force_noise=setting.sensor_noise,
            prefilter=setting.prefilter,
            time_domain=setting.domain,
            delay=setting.delay,
        )
    )
    return _axis(setting, controller)


def _preview(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    step = beat_preview_step(
        BeatPreview(
            plant=setting.plant,
            penalty=float(values[0]),
            preview=_PREVIEW,
            cell_width=_CELL,
            longest_beat=_LONGEST_BEAT,
            learning=float(values[2]),
            lag=float(values[3]),
            drive=float(values[1]),
            force_noise=setting.sensor_noise,
            prefilter=setting.prefilter,
            time_domain=setting.domain,
            delay=setting.delay,
        )
    )
    return TunedAxis(step=step, velocity_gain=setting.velocity_gain)
