"""The RST controllers: with fixed gains, with an integrator, and adapting in several ways."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

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
from mrac_design.controller.adaptive import AdaptiveRST, build_step, nominal_gains
from mrac_design.controller.oscillator import Oscillator
from mrac_design.controller.reference import DirectReference, LeadingInverse, ReferenceFeedforward
from mrac_design.controller.rivals.fixed_rst import FixedRST, fixed_rst
from mrac_design.controller.rivals.linear import build_linear_step
from mrac_design.controller.robust import GainBox, WithProjection
from mrac_design.design import (
    ReferenceModel,
    RSTDesign,
    RSTSpecification,
    design_rst,
    first_order_observer,
)

STIFFEST_FACTOR = 1.5
"""Stiffness, as a factor on the design's, up to which the certified contestant is proved stable."""

BANDWIDTH = TuningParameter(name="$\\omega$", unit="rad/s", low=80.0, high=1500.0, start=400.0)
DAMPING = TuningParameter(name="$\\xi$", unit="", low=0.5, high=3.0, start=1.2)
OBSERVER_RATIO = TuningParameter(name="$a_o/\\omega$", unit="", low=0.05, high=5.0, start=0.4)
OBSERVER_BANDWIDTH = TuningParameter(
    name="$\\omega_o$", unit="rad/s", low=20.0, high=1000.0, start=100.0
)
OBSERVER_DAMPING = TuningParameter(name="$\\xi_o$", unit="", low=0.02, high=2.0, start=0.5)
OBSERVER_POLE = TuningParameter(name="$a_o$", unit="rad/s", low=20.0, high=1000.0, start=100.0)
RESONANCE = TuningParameter(name="$\\nu$", unit="rad/s", low=5.0, high=100.0, start=30.0)
GAIN = TuningParameter(name="$\\hat\\gamma$", unit="", low=0.001, high=3.0, start=0.01)
NORMALISATION = TuningParameter(name="$\\alpha$", unit="N²", low=0.01, high=10.0, start=1.0)
BIAS = TuningParameter(name="bias regressor", unit="N", low=0.1, high=30.0, start=1.0)
BOX = TuningParameter(name="box", unit="", low=0.01, high=0.5, start=0.05)
HARMONIC = TuningParameter(name="harmonic regressors", unit="N", low=0.03, high=30.0, start=1.0)
TRACKING = TuningParameter(name="frequency tracking", unit="1/s", low=0.01, high=3.0, start=0.1)
_ADAPTATION = (GAIN, NORMALISATION, BIAS, BOX, HARMONIC, TRACKING)
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
    adaptive = (*rst, LEAD, GAIN, NORMALISATION)
    integral = (BANDWIDTH, DAMPING, OBSERVER_BANDWIDTH, OBSERVER_DAMPING)
    resonant = (*integral, OBSERVER_POLE, RESONANCE)
    boxed = (*resonant, LEAD, GAIN, NORMALISATION, BOX)
    knows_band = replace(_FIXED, motion_model=True)
    return (
        _contestant("frozen", "frozen RST", rst, _frozen),
        _contestant("frozen_inverse", "frozen RST + inverse", (*rst, LEAD), _frozen_inverse),
        _contestant("integral", "RST with integrator", (*integral, LEAD), _integral),
        _contestant("resonant", "RST with resonance", (*resonant, LEAD), _resonant, knows_band),
        _contestant("mrac", "MRAC", (*rst, GAIN, NORMALISATION), _mrac, _ADAPTING),
        _contestant("mrac_inverse", "MRAC + inverse", adaptive, _mrac_inverse, _ADAPTING),
        _contestant("mrac_bias", "MRAC + inverse + bias", (*adaptive, BIAS), _mrac_bias, _ADAPTING),
        _contestant(
            "mrac_certified",
            "MRAC + inverse + bias, boxed",
            (*adaptive, BIAS, BOX),
            _mrac_certified,
            _BOXED,
            _box_is_certified,
        ),
        _contestant(
            "mrac_resonant",
            "MRAC with resonance, boxed",
            boxed,
            _mrac_resonant,
            replace(_BOXED, motion_model=True),
            _resonant_box_is_certified,
        ),
        _contestant(
            "mrac_harmonic",
            "MRAC with resonance + harmonics, boxed",
            (*boxed, HARMONIC, TRACKING),
            _mrac_harmonic,
            replace(_BOXED, motion_model=True, periodicity=True),
            _resonant_box_is_certified,
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
        base=sum(parameter not in _ADAPTATION for parameter in parameters),
        build=build,
        proof=proof,
    )


def box_is_certified(setting: AxisSetting, design: RSTDesign, share: float) -> bool:
    """Whether a common Lyapunov function was found and proved, in exact arithmetic, for every
    path of the gains within ± `share` of the design's and every stiffness up to STIFFEST_FACTOR
    times the design's."""
    from mrac_design.controller.axis_loop import axis_loop
    from mrac_design.polynomials.rationals import decimal_rational
    from mrac_design.stability.certification import has_common_lyapunov_function
    from mrac_design.stability.parameter_box import relative_box
    from mrac_design.stability.sampled_loop import sampling

    timing = sampling(decimal_rational(setting.period), setting.delay)
    loop = axis_loop(design, [timing.period])
    tissue = (setting.stiffness, STIFFEST_FACTOR * setting.stiffness)
    return has_common_lyapunov_function(loop, relative_box(loop, share, tissue), timing)


def _box_is_certified(setting: AxisSetting, values: FloatArray) -> bool:
    return box_is_certified(setting, rst_design(setting, values), float(values[6]))


def _resonant_box_is_certified(setting: AxisSetting, values: FloatArray) -> bool:
    return box_is_certified(setting, _resonant_design(setting, values), float(values[9]))


def rst_design(setting: AxisSetting, values: FloatArray) -> RSTDesign:
    """The RST design of a tuning vector that begins with ω and ao/ω."""
    bandwidth, ratio = float(values[0]), float(values[1])
    return design_rst(
        RSTSpecification(
            plant=setting.plant,
            reference_model=ReferenceModel(bandwidth=bandwidth, damping=1.0),
            observer=first_order_observer(ratio * bandwidth),
        )
    )


def _integral_design(setting: AxisSetting, values: FloatArray) -> RSTDesign:
    """R = p (p + r1), of a tuning vector that begins with ω, ξ, ωo, ξo."""
    return design_rst(
        RSTSpecification(
            plant=setting.plant,
            reference_model=_model(values[:2]),
            observer=tuple(_model(values[2:4]).polynomial.tolist()),
            internal_model=(1.0, 0.0),
        )
    )


def _resonant_design(setting: AxisSetting, values: FloatArray) -> RSTDesign:
    """R = (p² + ν²)(p + r1), of a tuning vector that begins with ω, ξ, ωo, ξo, ao, ν."""
    Ao = np.polymul(_model(values[2:4]).polynomial, [1.0, float(values[4])])
    return design_rst(
        RSTSpecification(
            plant=setting.plant,
            reference_model=_model(values[:2]),
            observer=tuple(Ao.tolist()),
            internal_model=(1.0, 0.0, float(values[5]) ** 2),
        )
    )


def _model(values: FloatArray) -> ReferenceModel:
    return ReferenceModel(bandwidth=float(values[0]), damping=float(values[1]))


def _axis(
    setting: AxisSetting,
    design: RSTDesign,
    law: AdaptationLaw,
    *,
    feedforward: ReferenceFeedforward,
    bias: float = 0.0,
    oscillator: Oscillator | None = None,
) -> TunedAxis:
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
    return _axis(setting, rst_design(setting, values), _STILL, feedforward=DirectReference())


def _frozen_inverse(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    return _axis(
        setting, rst_design(setting, values), _STILL, feedforward=LeadingInverse(float(values[2]))
    )


def _integral(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    return _fixed(setting, _integral_design(setting, values), float(values[4]))


def _resonant(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    return _fixed(setting, _resonant_design(setting, values), float(values[6]))


def _fixed(setting: AxisSetting, design: RSTDesign, lead: float) -> TunedAxis:
    controller = fixed_rst(
        FixedRST(
            design=design,
            prefilter=setting.prefilter,
            feedforward=LeadingInverse(lead),
            time_domain=setting.domain,
        )
    )
    return TunedAxis(step=build_linear_step(controller), velocity_gain=setting.velocity_gain)


def _law(values: FloatArray) -> NormalisedGradientLaw:
    """The law of γ̂ and α."""
    return NormalisedGradientLaw(gain=float(values[0]), alpha=float(values[1]))


def _boxed(
    design: RSTDesign, law: NormalisedGradientLaw, share: float, *, harmonics: int = 0
) -> WithProjection:
    """The law with its gains in the box; bias and harmonics bounded as well."""
    box = GainBox.around(nominal_gains(design), fraction=share)
    free = (_BOUNDED,) * (1 + 2 * harmonics)
    return WithProjection(
        law=law,
        box=GainBox(lower=(*box.lower, *(-b for b in free)), upper=(*box.upper, *free)),
    )


def _mrac(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    design = rst_design(setting, values)
    return _axis(setting, design, _law(values[2:]), feedforward=DirectReference())


def _mrac_inverse(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    design, lead = rst_design(setting, values), LeadingInverse(float(values[2]))
    return _axis(setting, design, _law(values[3:]), feedforward=lead)


def _mrac_bias(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    design, lead = rst_design(setting, values), LeadingInverse(float(values[2]))
    return _axis(setting, design, _law(values[3:]), feedforward=lead, bias=float(values[5]))


def _mrac_certified(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    design, lead = rst_design(setting, values), LeadingInverse(float(values[2]))
    law = _boxed(design, _law(values[3:]), float(values[6]))
    return _axis(setting, design, law, feedforward=lead, bias=float(values[5]))


def _mrac_resonant(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    design, lead = _resonant_design(setting, values), LeadingInverse(float(values[6]))
    law = _boxed(design, _law(values[7:]), float(values[9]))
    return _axis(setting, design, law, feedforward=lead)


def _mrac_harmonic(setting: AxisSetting, periods: Periods, values: FloatArray) -> TunedAxis:
    design, lead = _resonant_design(setting, values), LeadingInverse(float(values[6]))
    law = _boxed(design, _law(values[7:]), float(values[9]), harmonics=HARMONICS)
    oscillator = Oscillator(
        frequency=1.0 / periods.beat,
        lowest=0.7 / periods.beat,
        highest=1.4 / periods.beat,
        harmonics=HARMONICS,
        force=float(values[10]),
        tracking=float(values[11]),
        floor=0.01,
    )
    return _axis(setting, design, law, feedforward=lead, oscillator=oscillator)
