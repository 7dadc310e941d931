"""The RST controllers: with fixed gains, with an integrator, and adapting in several ways."""

from __future__ import annotations

from dataclasses import replace

from mrac_design.arrays import FloatArray
from mrac_design.comparison.contestant import (
    LEAD,
    Build,
    Contestant,
    Family,
    Features,
    Proof,
    TunedAxis,
    TuningParameter,
)
from mrac_design.comparison.setting import AxisSetting, Periods
from mrac_design.controller.adaptation import AdaptationLaw, NormalisedGradientLaw
from mrac_design.controller.adaptive import GAIN_NAMES, AdaptiveRST, build_step, nominal_gains
from mrac_design.controller.disturbance_observer import with_disturbance_observer
from mrac_design.controller.oscillator import Oscillator
from mrac_design.controller.reference import DirectReference, LeadingInverse, ReferenceFeedforward
from mrac_design.controller.rivals.linear import build_linear_step
from mrac_design.controller.rivals.rst_integral import IntegralRST, integral_rst
from mrac_design.controller.robust import GainBox, WithProjection
from mrac_design.design import ReferenceModel, RSTDesign, RSTSpecification, design_rst

STIFFEST_FACTOR = 1.5
"""Stiffness, as a factor on the design's, up to which the certified contestant is proved stable."""

BANDWIDTH = TuningParameter(name="$\\omega$", unit="rad/s", low=80.0, high=1500.0, start=400.0)
OBSERVER_RATIO = TuningParameter(name="$a_o/\\omega$", unit="", low=0.05, high=5.0, start=0.4)
GAIN = TuningParameter(name="$\\hat\\gamma$", unit="", low=0.003, high=3.0, start=0.2)
NORMALISATION = TuningParameter(name="$\\alpha$", unit="N²", low=0.01, high=10.0, start=1.0)
BIAS = TuningParameter(name="bias regressor", unit="N", low=0.1, high=30.0, start=1.0)
BOX = TuningParameter(name="box", unit="", low=0.01, high=0.5, start=0.05)
HARMONIC = TuningParameter(name="harmonic regressors", unit="N", low=0.03, high=30.0, start=1.0)
TRACKING = TuningParameter(name="frequency tracking", unit="1/s", low=0.01, high=3.0, start=0.1)
DRIVE = TuningParameter(name="drive", unit="m/s²", low=1e-3, high=20.0, start=0.02)
HARMONICS = 5
"""Harmonics of the beat among the regressors."""
_BOUNDED = 50.0
"""Largest scaled gain of bias and harmonics when the gains are kept in a box."""

_FIXED = Features(
    motion_model=False,
    periodicity=False,
    ecg=False,
    adapts=False,
    linear=True,
    proof="fixed gains: poles",
)
_ADAPTING = Features(
    motion_model=False,
    periodicity=False,
    ecg=False,
    adapts=True,
    linear=False,
    proof="without motion only",
)
_BOXED = Features(
    motion_model=False,
    periodicity=False,
    ecg=False,
    adapts=True,
    linear=False,
    proof="stable for every path of the gains in the box",
)
_STILL = NormalisedGradientLaw(gain=0.0, alpha=1.0)


def rst_contestants() -> tuple[Contestant, ...]:
    """The whole family, from the paper's controller without adaptation upwards."""
    rst = (BANDWIDTH, OBSERVER_RATIO)
    adaptive = (*rst, GAIN, NORMALISATION)
    return (
        _contestant("frozen", "frozen RST", rst, _frozen),
        _contestant("frozen_inverse", "frozen RST + inverse", (*rst, LEAD), _frozen_inverse),
        _contestant(
            "integral",
            "RST with integrator",
            (
                BANDWIDTH,
                TuningParameter(
                    name="$\\omega_o$", unit="rad/s", low=20.0, high=1000.0, start=100.0
                ),
                TuningParameter(name="$\\xi_o$", unit="", low=0.2, high=2.0, start=0.7),
                LEAD,
            ),
            _integral,
        ),
        _contestant("mrac", "MRAC", adaptive, _mrac, _ADAPTING),
        _contestant("mrac_inverse", "MRAC + inverse", (*adaptive, LEAD), _mrac_inverse, _ADAPTING),
        _contestant(
            "mrac_bias", "MRAC + inverse + bias", (*adaptive, BIAS, LEAD), _mrac_bias, _ADAPTING
        ),
        _contestant(
            "mrac_certified",
            "MRAC + inverse + bias, boxed",
            (*adaptive, BIAS, BOX, LEAD),
            _mrac_certified,
            _BOXED,
            box_is_certified,
        ),
        _contestant(
            "mrac_harmonic",
            "MRAC + inverse + harmonics, boxed",
            (*adaptive, BIAS, BOX, HARMONIC, TRACKING, LEAD),
            _mrac_harmonic,
            replace(_BOXED, motion_model=True, periodicity=True),
            box_is_certified,
        ),
        _contestant(
            "frozen_observer",
            "frozen RST + inverse + observer",
            (*rst, DRIVE, LEAD),
            _frozen_observer,
            replace(_FIXED, motion_model=True),
        ),
        _contestant(
            "mrac_observer",
            "MRAC + inverse + observer",
            (*adaptive, DRIVE, LEAD),
            _mrac_observer,
            replace(_ADAPTING, motion_model=True, proof="none yet"),
        ),
    )


def _contestant(
    name: str,
    title: str,
    parameters: tuple[TuningParameter, ...],
    build: Build,
    features: Features = _FIXED,
    proof: Proof | None = None,
) -> Contestant:
    return Contestant(
        name=name,
        title=title,
        family=Family.ADAPTIVE if features.adapts else Family.FROZEN,
        features=features,
        parameters=parameters,
        build=build,
        proof=proof,
    )


def box_is_certified(setting: AxisSetting, values: FloatArray) -> bool:
    """Whether a common Lyapunov function was found and proved, in exact arithmetic, for every
    path of the gains in the box and every stiffness up to STIFFEST_FACTOR times the design's.

    `values` begin with ω, ao/ω, γ̂, α, bias and the box.
    """
    from mrac_design.stability.adaptive_loop import adaptive_loop, relative_box
    from mrac_design.stability.certification import has_common_lyapunov_function
    from mrac_design.stability.sampled_loop import sampling

    design = rst_design(setting, values)
    loop = adaptive_loop(
        design_stiffness=setting.stiffness,
        velocity_gain=setting.velocity_gain,
        bandwidth=design.specification.reference_model.bandwidth,
        observer_pole=design.specification.observer_pole,
        gains=tuple(design.parameters[:3]),
    )
    tissue = (setting.stiffness, STIFFEST_FACTOR * setting.stiffness)
    box = relative_box(loop, float(values[5]), tissue)
    return has_common_lyapunov_function(loop, box, sampling(setting.period, setting.delay))


def rst_design(setting: AxisSetting, values: FloatArray) -> RSTDesign:
    """The RST design of a tuning vector that begins with ω and ao/ω."""
    bandwidth, ratio = float(values[0]), float(values[1])
    return design_rst(
        RSTSpecification(
            plant=setting.plant,
            reference_model=ReferenceModel(bandwidth=bandwidth, damping=1.0),
            observer_pole=ratio * bandwidth,
        )
    )


def _axis(
    setting: AxisSetting,
    values: FloatArray,
    law: AdaptationLaw,
    *,
    feedforward: ReferenceFeedforward,
    bias: float = 0.0,
    oscillator: Oscillator | None = None,
) -> TunedAxis:
    design = rst_design(setting, values)
    step = build_step(
        AdaptiveRST(
            design=design,
            prefilter=setting.prefilter,
            law=law,
            feedforward=feedforward,
            bias_force=bias,
            initial_gains=nominal_gains(design),
            time_domain=setting.domain,
            oscillator=oscillator,
        )
    )
    return TunedAxis(step=step, velocity_gain=setting.velocity_gain)


def _frozen(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    return _axis(setting, values, _STILL, feedforward=DirectReference())


def _frozen_inverse(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    return _axis(setting, values, _STILL, feedforward=LeadingInverse(float(values[-1])))


def _integral(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    controller = integral_rst(
        IntegralRST(
            plant=setting.plant,
            reference_model=ReferenceModel(bandwidth=float(values[0]), damping=1.0),
            observer=ReferenceModel(bandwidth=float(values[1]), damping=float(values[2])),
            prefilter=setting.prefilter,
            feedforward=LeadingInverse(float(values[-1])),
            time_domain=setting.domain,
        )
    )
    return TunedAxis(step=build_linear_step(controller), velocity_gain=setting.velocity_gain)


def _law(values: FloatArray) -> NormalisedGradientLaw:
    return NormalisedGradientLaw(gain=float(values[2]), alpha=float(values[3]))


def _boxed(setting: AxisSetting, values: FloatArray, extra: int) -> WithProjection:
    """The law with its gains in the box, bias and harmonics bounded as well."""
    centre = nominal_gains(rst_design(setting, values))
    box = GainBox.around(centre, fraction=float(values[5]))
    free = (_BOUNDED,) * extra
    return WithProjection(
        law=_law(values),
        box=GainBox(lower=(*box.lower, *(-b for b in free)), upper=(*box.upper, *free)),
    )


def _mrac(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    return _axis(setting, values, _law(values), feedforward=DirectReference())


def _mrac_inverse(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    return _axis(setting, values, _law(values), feedforward=LeadingInverse(float(values[-1])))


def _mrac_bias(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    bias = float(values[4])
    return _axis(
        setting, values, _law(values), feedforward=LeadingInverse(float(values[-1])), bias=bias
    )


def _mrac_certified(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    law = _boxed(setting, values, len(GAIN_NAMES) - 5)
    return _axis(
        setting, values, law, feedforward=LeadingInverse(float(values[-1])), bias=float(values[4])
    )


def _mrac_harmonic(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    oscillator = Oscillator(
        frequency=1.0 / periods.beat,
        lowest=0.7 / periods.beat,
        highest=1.4 / periods.beat,
        harmonics=HARMONICS,
        force=float(values[6]),
        tracking=float(values[7]),
        floor=0.01,
    )
    law = _boxed(setting, values, len(GAIN_NAMES) - 5 + 2 * HARMONICS)
    return _axis(
        setting,
        values,
        law,
        feedforward=LeadingInverse(float(values[-1])),
        bias=float(values[4]),
        oscillator=oscillator,
    )


def _observed(setting: AxisSetting, axis: TunedAxis, drive: float) -> TunedAxis:
    step = with_disturbance_observer(
        axis.step,
        plant=setting.plant,
        domain=setting.domain,
        delay=setting.delay,
        drive=drive,
        force_noise=setting.sensor_noise,
    )
    return replace(axis, step=step)


def _frozen_observer(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    return _observed(setting, _frozen_inverse(setting, periods, values), float(values[2]))


def _mrac_observer(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    return _observed(setting, _mrac_inverse(setting, periods, values), float(values[4]))
