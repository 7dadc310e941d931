"""Random tuned gains for the export tests."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from hypothesis import strategies as st

from mrac_design.controller.adaptation import GradientLaw, NormalisedGradientLaw
from mrac_design.controller.linearisation import RobotModelError
from mrac_design.controller.reference import DirectReference, ModelInverse
from mrac_design.controller.robust import (
    GainBox,
    WithDeadZone,
    WithErrorLeakage,
    WithLeakage,
    WithProjection,
)
from mrac_design.design import ReferenceModel, RSTSpecification, design_rst
from mrac_design.export.gain_set import GainSet, RobotFingerprint, gain_set
from mrac_design.plant import ForcePlant
from mrac_design.simulation.scenario import load_scenario
from mrac_design.study import VARIANTS, scenario_design

INFINITY = float("inf")


@cache
def nominal_gain_set() -> GainSet:
    scenario = load_scenario("nominal")
    return gain_set(scenario, scenario_design(scenario), VARIANTS[-1])


@cache
def internal_model_gain_set() -> GainSet:
    """Gains of a third-degree observer with a damped resonance in R."""
    scenario = load_scenario("nominal")
    choice = replace(
        scenario.design,
        observer=(1.0, 500.0, 90000.0, 6e6),
        internal_model=(1.0, 10.0, 1400.0),
    )
    scenario = replace(scenario, design=choice)
    return gain_set(scenario, scenario_design(scenario), VARIANTS[-1])


def numbers(low: float, high: float, digits: int = 17):
    """Floats of at most `digits` decimal digits, the limits included."""
    return st.floats(low, high).map(lambda x: min(max(float(f"{x:.{digits}g}"), low), high))


positive = numbers(1e-9, 1e9)


@st.composite
def boxes(draw) -> GainBox:
    size = draw(st.integers(1, 6))
    ends = numbers(-1e3, 1e3) | st.sampled_from([-INFINITY, INFINITY])
    pairs = [sorted((draw(ends), draw(ends))) for _ in range(size)]
    return GainBox(lower=tuple(a for a, _ in pairs), upper=tuple(b for _, b in pairs))


@st.composite
def laws(draw, gains):
    """Laws with any wrappers, the innermost one's gain drawn from `gains`."""
    law = draw(
        gains.map(lambda gain: GradientLaw(gain=gain))
        | st.builds(NormalisedGradientLaw, gain=gains, alpha=positive)
    )
    for wrapper in draw(st.permutations(range(4)))[: draw(st.integers(0, 4))]:
        centre = draw(st.lists(numbers(-1e3, 1e3), max_size=6).map(tuple))
        size = draw(numbers(0.0, 1e3))
        law = [
            lambda law=law: WithProjection(law=law, box=draw(boxes())),
            lambda law=law, size=size: WithDeadZone(law=law, width=size),
            lambda law=law, size=size, c=centre: WithLeakage(law=law, leakage=size, centre=c),
            lambda law=law, size=size, c=centre: WithErrorLeakage(law=law, leakage=size, centre=c),
        ][wrapper]()
    return law


@st.composite
def observers(draw, digits: int = 17) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Ao of degree 1, 2 or 3 and D of one degree less: none, p or a resonance, damped or not."""

    def pole() -> float:
        return draw(numbers(10.0, 3000.0, digits))

    def pair(least: float, most: float) -> tuple[float, float, float]:
        frequency, damping = draw(numbers(least, most, 5)), draw(numbers(0.2, 1.5, 3))
        return 1.0, float(f"{2 * damping * frequency:.{digits}g}"), frequency * frequency

    degree = draw(st.integers(1, 3))
    if degree == 1:
        return (1.0, pole()), (1.0,)
    if degree == 2:
        root = draw(st.just(0.0) | numbers(1e-3, 20.0, digits))
        return pair(10.0, 1000.0), (1.0, draw(st.sampled_from([root, -root])))
    _, damping, stiffness = pair(10.0, 1000.0)
    last = pole()
    cubic = (1.0, damping + last, stiffness + damping * last, stiffness * last)
    _, damping, stiffness = pair(2.0, 60.0)
    observer = tuple(float(f"{value:.{digits}g}") for value in cubic)
    return observer, (1.0, damping * draw(st.sampled_from([0.0, 0.1, 1.0])), stiffness)


@st.composite
def gain_sets(draw, digits: int = 17) -> GainSet:
    """Gains of random designs; their numbers have at most `digits` digits."""
    observer, internal_model = draw(observers(digits))

    def model(low: float, high: float) -> ReferenceModel:
        return ReferenceModel(
            bandwidth=draw(numbers(low, high, digits)), damping=draw(numbers(0.3, 2.0, digits))
        )

    design = design_rst(
        RSTSpecification(
            plant=ForcePlant(
                stiffness=draw(numbers(50.0, 5000.0, digits)),
                velocity_gain=draw(st.just(0.0) | numbers(1e-3, 300.0, digits)),
            ),
            reference_model=model(10.0, 2000.0),
            observer=observer,
            internal_model=internal_model,
        )
    )
    factor = numbers(0.5, 2.0)
    count = len(design.coefficients)
    scaled = st.lists(numbers(-1e3, 1e3), min_size=count, max_size=count).map(tuple)
    several = st.lists(numbers(0.0, 100.0), min_size=count + 1, max_size=count + 1).map(tuple)
    return GainSet(
        scenario=draw(
            st.text(
                min_size=1,
                max_size=12,
                alphabet=st.characters(
                    codec="utf-8", exclude_categories=["Cc", "Cs", "Zl", "Zp", "Cn", "Co"]
                ),
            )
        ),
        package_version="0.1.0",
        robot=RobotFingerprint(file="robot.toml", sha256="0" * 64),
        specification=design.specification,
        coefficients=tuple(value for _, value, _ in design.coefficients),
        initial_gains=draw(scaled | st.just(tuple(design.scaled_parameters.tolist()))),
        prefilter=model(1.0, 100.0) if draw(st.booleans()) else None,
        feedforward=draw(st.sampled_from([DirectReference(), ModelInverse()])),
        law=draw(laws(numbers(0.0, 100.0) | several)),
        bias_force=draw(numbers(0.0, 10.0)),
        tool_axis_bandwidth=draw(positive),
        robot_model=RobotModelError(body_scale=draw(factor), first_joint_scale=draw(factor)),
    )
