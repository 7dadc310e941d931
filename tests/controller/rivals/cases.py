"""Every rival, tuned moderately for the nominal axis, for tests that hold for all."""

from __future__ import annotations

from dataclasses import replace

from mrac_design.controller.reference import ModelInverse
from mrac_design.controller.rivals.active_observer import (
    ActiveObserver,
    ObserverTuning,
    active_observer,
)
from mrac_design.controller.rivals.beat_preview import BeatPreview, beat_preview_step
from mrac_design.controller.rivals.fixed_rst import FixedRST, fixed_rst
from mrac_design.controller.rivals.harmonics import Rhythm, RhythmObserver
from mrac_design.controller.rivals.learning import IterativeLearning, iterative_learning
from mrac_design.controller.rivals.linear import build_linear_step
from mrac_design.controller.rivals.prediction import Horizon
from mrac_design.controller.rivals.predictive import PredictiveControl, predictive_control
from mrac_design.controller.rivals.predictive_observer import (
    PredictiveObserver,
    predictive_observer,
)
from mrac_design.design import ReferenceModel, RSTSpecification, design_rst
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Continuous, Discrete

STIFFNESS, VELOCITY_GAIN, PERIOD, DELAY = 800.0, 50.0, 1e-3, 1
PLANT = ForcePlant(stiffness=STIFFNESS, velocity_gain=VELOCITY_GAIN)
DOMAIN = Discrete(PERIOD)
PREFILTER = ReferenceModel(bandwidth=50.0, damping=1.0)

RST = FixedRST(
    design=design_rst(
        RSTSpecification(
            plant=PLANT,
            reference_model=ReferenceModel(bandwidth=300.0, damping=1.0),
            observer=(1.0, 2 * 0.9 * 250.0, 250.0**2),
            internal_model=(1.0, 0.0),
        )
    ),
    prefilter=PREFILTER,
    feedforward=ModelInverse(),
    time_domain=Continuous(),
)
FORCE_LOOP = ObserverTuning(
    order=1, time_constant=0.004, drive=1.0, input_noise=2.0, force_noise=0.02
)
OBSERVER = ActiveObserver(
    plant=PLANT,
    force_loop=FORCE_LOOP,
    motion_loop=None,
    prefilter=PREFILTER,
    feedforward=ModelInverse(),
    time_domain=DOMAIN,
    delay=DELAY,
)
MOTION_LOOP = ObserverTuning(
    order=1, time_constant=0.004, drive=1e-3, input_noise=0.0, force_noise=0.02
)
PREDICTIVE = PredictiveControl(
    plant=PLANT,
    horizon=Horizon(first=2, last=15, moves=3, penalty=1e-6),
    observer_poles=(0.8, 0.6),
    breath=None,
    rhythms=None,
    prefilter=PREFILTER,
    time_domain=DOMAIN,
    delay=DELAY,
)
BEAT = Rhythm(frequency=1.25, harmonics=3, drive=1e-2)
RHYTHMS = RhythmObserver(rhythms=(BEAT,), slow_drive=0.01, force_noise=0.02)
PREDICTIVE_OBSERVER = PredictiveObserver(
    plant=PLANT,
    horizon=Horizon(first=1, last=12, moves=2, penalty=1e-6),
    order=1,
    drive=1.0,
    force_noise=0.02,
    prefilter=PREFILTER,
    time_domain=DOMAIN,
    delay=DELAY,
)
LEARNING = IterativeLearning(
    proportional=2.0,
    integral=5.0,
    learning=1.0,
    lead=25,
    repetition=400,
    cutoff=12.0,
    half_width=100,
    prefilter=PREFILTER,
    time_domain=DOMAIN,
)
PREVIEW = BeatPreview(
    plant=PLANT,
    penalty=1e-6,
    preview=6,
    cell_width=0.02,
    longest_beat=1.2,
    learning=0.8,
    lag=0.004,
    drive=0.3,
    force_noise=0.02,
    prefilter=PREFILTER,
    time_domain=DOMAIN,
    delay=DELAY,
)


def linear_rivals():
    """(name, controller) of every rival that is linear."""
    return {
        "integral RST": fixed_rst(RST),
        "sampled integral RST": fixed_rst(replace(RST, time_domain=DOMAIN)),
        "active observer": active_observer(OBSERVER),
        "active observer of order 2": active_observer(
            replace(OBSERVER, force_loop=replace(FORCE_LOOP, order=2, drive=0.1))
        ),
        "active observer without dead time": active_observer(replace(OBSERVER, delay=0)),
        "two active observers": active_observer(replace(OBSERVER, motion_loop=MOTION_LOOP)),
        "predictive": predictive_control(PREDICTIVE),
        "predictive with breath": predictive_control(replace(PREDICTIVE, breath=100)),
        "predictive with beat": predictive_control(replace(PREDICTIVE, rhythms=RHYTHMS)),
        "predictive observer": predictive_observer(PREDICTIVE_OBSERVER),
        "predictive observer without dead time": predictive_observer(
            replace(PREDICTIVE_OBSERVER, delay=0)
        ),
        "learning": iterative_learning(LEARNING),
    }


def rival_steps():
    """(name, step) of every rival."""
    steps = {name: build_linear_step(rival) for name, rival in linear_rivals().items()}
    return {**steps, "beat preview": beat_preview_step(PREVIEW)}
