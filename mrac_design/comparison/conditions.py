"""The motions of a comparison: one to tune on, and those nobody was tuned on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.comparison.limit import MotionSpectrum, motion_spectrum
from mrac_design.comparison.setting import AxisSetting, Condition, Periods
from mrac_design.motion import (
    AXES,
    PiecewisePolynomial,
    WithEctopicBeat,
    constant_force,
    find_model,
    quintic_hermite,
    read_recorded_motion,
    square_wave,
)
from mrac_design.motion.beats import find_beats
from mrac_design.motion.dual_fourier import DualFourierModel
from mrac_design.motion.fit_series import Recording, breathing_frequency
from mrac_design.simulation.scenario import MotionChoice

TRAINING_SHARE = 0.8
"""Share of a recording that may be tuned on: frames 1–600 of 750."""
MODEL_DURATION, SETTLING = 30.0, 6.0
"""Length of generated motions and where judging begins (s)."""
LOWEST_FORCE, HIGHEST_FORCE, HALF_PERIOD = 1.0, 2.0, 3.0
"""Steps of the reference (N) and the time between them (s)."""
EVENT_TIME = 12.0
"""When the ectopic beat comes and breathing stops, about (s)."""
_FASTEST_BREATH = 0.4  # Hz
_NODES = 0.005  # s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ConditionSet:
    """Everything contestants are run on."""

    training: Condition
    """What they are tuned on."""
    judged: tuple[Condition, ...]
    """What they are judged on, the held-back motion first."""
    spectrum: MotionSpectrum
    """Spectrum of the training motion, from which the last judged condition is drawn."""


def condition_set(
    setting: AxisSetting,
    motion: MotionChoice,
    *,
    axis: str,
    stiffness_factor: float,
    stranger_count: int | None = None,
) -> ConditionSet:
    """Conditions around a motion, on one axis ("X", "Y", "Z").

    A recording is tuned on its first 80 % and judged on the rest; a model is tuned on one seed
    and judged on another. `stranger_count` takes only the first so many unseen motions.
    Raises MotionFileError for a motion that cannot be used.
    """
    channel = AXES.index(axis)
    source = Path(motion.source)
    if source.suffix and source.suffix != ".toml":
        training, held_back = _recorded(motion, channel)
    else:
        training, held_back = _generated(find_model(motion.source), channel)
    stiffer = replace(
        held_back,
        name="stiffer",
        title=f"held back, stiffness × {stiffness_factor:g}",
        stiffness_factor=stiffness_factor,
    )
    spectrum = motion_spectrum(training.heart, end=training.duration, period=setting.period)
    random = _random(spectrum, training.periods)
    strangers = _strangers(channel)[:stranger_count]
    return ConditionSet(
        training=training, judged=(held_back, stiffer, *strangers, random), spectrum=spectrum
    )


def _recorded(motion: MotionChoice, channel: int) -> tuple[Condition, Condition]:
    recording = read_recorded_motion(
        motion.source, point=motion.point, frame_rate=motion.frame_rate, cutoff=motion.cutoff
    )
    onsets, periods = _measured_rhythms(recording.displacement, motion.frame_rate)
    heart = recording.displacement.selected([channel])
    frames = round(heart.end * motion.frame_rate) + 1
    border = round(TRAINING_SHARE * frames) / motion.frame_rate
    base = Condition(
        name="training",
        title=f"tuned on: {recording.name}, first {border:g} s",
        heart=heart.restricted(0.0, border),
        reference=_steps(border),
        beats=onsets,
        periods=periods,
        stiffness_factor=1.0,
        settling=SETTLING,
    )
    held_back = replace(
        base,
        name="held_back",
        title=f"held back: the last {heart.end - border:.3g} s of the recording",
        heart=heart,
        reference=_steps(heart.end),
        settling=border,
    )
    return base, held_back


def _measured_rhythms(
    displacement: PiecewisePolynomial, frame_rate: float
) -> tuple[FloatArray, Periods]:
    """Instants of the beats (s), found in the motion without breathing, and both usual periods."""
    from scipy.signal import butter, filtfilt

    frames = int(np.floor(displacement.end * frame_rate + 1e-9)) + 1
    position = displacement(np.minimum(np.arange(frames) / frame_rate, displacement.end)).T
    b, a = butter(3, _FASTEST_BREATH / (0.5 * frame_rate), "high")
    beats = find_beats(
        filtfilt(b, a, position, axis=0),
        frame_rate=frame_rate,
        training=round(TRAINING_SHARE * frames),
    )
    training = beats.onsets[beats.onsets < TRAINING_SHARE * displacement.end]
    breath = breathing_frequency(
        Recording(position=position, frame_rate=frame_rate, training=round(TRAINING_SHARE * frames))
    )
    return beats.onsets, Periods(beat=float(np.diff(training).mean()), breath=1.0 / breath)


def _generated(model: DualFourierModel, channel: int) -> tuple[Condition, Condition]:
    training = _from_model(model, channel, "training", f"tuned on: {model.name}")
    other = model.with_seed(model.seed + 1)
    title = f"held back: {model.name}, other random numbers"
    return training, _from_model(other, channel, "held_back", title)


def _strangers(channel: int) -> Sequence[Condition]:
    """Motions that nobody was tuned on: assumed ones, regular, fast, irregular, interrupted."""
    regular = find_model("parametric")
    fast, irregular = find_model("parametric_fast"), find_model("parametric_jitter")
    beat = int(EVENT_TIME / regular.rhythm.mean_period)
    ectopic = replace(
        regular, rhythm=WithEctopicBeat(rhythm=regular.rhythm, beat=beat, prematurity=0.35)
    )
    apnoea = replace(regular, breathing=replace(regular.breathing, stop=EVENT_TIME))
    cases = (
        ("regular", "large regular motion, 75 beats a minute", regular),
        ("fast", "120 beats a minute", fast),
        ("irregular", "beat lengths ± 5 %", irregular),
        ("ectopic", "an ectopic beat", ectopic),
        ("apnoea", "breathing stops", apnoea),
    )
    return [_from_model(model, channel, name, title) for name, title, model in cases]


def _from_model(model: DualFourierModel, channel: int, name: str, title: str) -> Condition:
    return Condition(
        name=name,
        title=title,
        heart=model.motion(MODEL_DURATION).displacement.selected([channel]),
        reference=_steps(MODEL_DURATION),
        beats=model.onsets(MODEL_DURATION),
        periods=Periods(beat=model.rhythm.mean_period, breath=1.0 / model.breathing.frequency),
        stiffness_factor=1.0,
        settling=SETTLING,
    )


def _random(spectrum: MotionSpectrum, periods: Periods) -> Condition:
    """A Gaussian motion of the training motion's spectrum, under a constant force: exactly what
    the limit is computed for."""
    nodes = readonly(np.arange(round(MODEL_DURATION / _NODES) + 1) * _NODES)
    value, rate, second = spectrum.realisation(nodes, seed=0)
    return Condition(
        name="random",
        title="random motion of the tuned motion's spectrum, constant force",
        heart=quintic_hermite(nodes, value[None], rate[None], second[None]),
        reference=constant_force(LOWEST_FORCE).piecewise(MODEL_DURATION),
        beats=np.arange(0.0, MODEL_DURATION, periods.beat),
        periods=periods,
        stiffness_factor=1.0,
        settling=SETTLING,
    )


def _steps(end: float) -> PiecewisePolynomial:
    return square_wave(
        first=LOWEST_FORCE,
        second=HIGHEST_FORCE,
        half_period=HALF_PERIOD,
        first_switch=HALF_PERIOD,
        duration=end,
    ).piecewise(end)
