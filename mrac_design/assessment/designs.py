"""A scenario's design together with its certificate, and what to change when there is none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mrac_design.assessment.advisor import axis_controller, with_bandwidth
from mrac_design.assessment.choices import StabilityChoices
from mrac_design.assessment.linearisation import certificate_gap
from mrac_design.controller.adaptive import build_step
from mrac_design.controller.axis_loop import axis_loop
from mrac_design.design import RSTDesign
from mrac_design.errors import ParameterError
from mrac_design.polynomials.rationals import decimal_rational
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.single_axis import build_axis_loop, build_sampled_axis_loop
from mrac_design.stability import (
    DesignMap,
    Sampling,
    StabilityCertificate,
    certify,
    design_map,
    relative_box,
)
from mrac_design.stability.certificate import Timing
from mrac_design.stability.rational_function import to_float
from mrac_design.study import scenario_design
from mrac_design.time_domain import Continuous


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CertifiedDesign:
    """A design and what could be proved of it."""

    title: str
    """Name for people."""
    scenario: Scenario
    """The scenario with this design."""
    design: RSTDesign
    """The controller."""
    certificate: StabilityCertificate
    """The proof, or why there is none."""
    share: float
    """How far the feedback gains may leave nominal in the certified box, relative."""
    gap: float
    """Largest relative difference between the certificate's matrices and the code that runs."""


def continuous_design(scenario: Scenario, choices: StabilityChoices) -> CertifiedDesign:
    """The scenario's own design with its law in continuous time."""
    title = f"continuous, ω = {scenario.design.bandwidth:g} rad/s"
    return _certified(title, scenario, Continuous(), choices.continuous_box, choices)


def sampled_design(scenario: Scenario, choices: StabilityChoices) -> CertifiedDesign:
    """The design moved to the bandwidth chosen for a processor, sampled and delayed."""
    sampled = choices.sampled
    late = "no delay" if sampled.delay == 0 else f"delay {sampled.delay}"
    title = f"sampled at {sampled.rate:g} Hz, {late}, ω = {sampled.bandwidth:g} rad/s"
    moved = with_bandwidth(scenario, bandwidth=sampled.bandwidth)
    return _certified(title, moved, sampled.timing, sampled.box, choices)


def map_of_designs(
    scenario: Scenario,
    choices: StabilityChoices,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> DesignMap:
    """Bandwidth × sampling → largest certified box, with ao = ω and the scenario's K2."""
    designs = [
        scenario_design(with_bandwidth(scenario, bandwidth=bandwidth))
        for bandwidth in choices.map.bandwidths
    ]
    return design_map(
        [
            axis_loop(design, dict.fromkeys(s.period for s in choices.map.samplings))
            for design in designs
        ],
        choices.map.samplings,
        choices.tissue,
        resolution=decimal_rational(choices.map.resolution),
        progress=progress,
    )


def remedies(
    found: DesignMap, *, bandwidth: float, timing: Sampling, fraction: float
) -> tuple[str, ...]:
    """What to change to certify a box of ± `fraction`, as plain sentences from the design map.

    `bandwidth` (rad/s) and `timing` are those that fail (or do: then that is said). Raises
    ParameterError for a timing that is not in the map.
    """
    if timing not in found.samplings:
        raise ParameterError("timing", timing, "is not a column of the design map")
    reached = np.nan_to_num(found.fractions, nan=-1.0) >= fraction - found.resolution / 1e6
    column = found.samplings.index(timing)
    rate = 1 / to_float(timing.period)
    rows = np.flatnonzero(reached[:, column])
    wide = f"±{100 * fraction:g} %"
    sentences = []
    if any(found.bandwidths[rows] >= bandwidth):
        return (f"{wide} is certified at ω = {bandwidth:g} rad/s and {rate:g} Hz as it is.",)
    if len(rows):
        best = found.bandwidths[rows].max()
        sentences.append(
            f"Lower ω from {bandwidth:g} to {best:g} rad/s: at {rate:g} Hz with "
            f"{_late(timing)} {wide} is then certified."
        )
    row = int(np.argmin(np.abs(found.bandwidths - bandwidth)))
    for other in np.flatnonzero(reached[row]):
        better = found.samplings[int(other)]
        sentences.append(
            f"Sample at {1 / to_float(better.period):g} Hz with {_late(better)} and keep "
            f"ω = {found.bandwidths[row]:g} rad/s."
        )
    share = found.fractions[row, column]
    if not np.isnan(share) and share > 0:
        sentences.append(f"Project the gains to ±{100 * share:g} %, which is certified as it is.")
    return tuple(sentences) or (
        f"Nothing in the map reaches {wide}: narrow the stiffness range, lower ω further, or "
        "sample faster.",
    )


def _late(timing: Sampling) -> str:
    """A delay in words."""
    if timing.delay == 0:
        return "no delay"
    return "a sample of delay" if timing.delay == 1 else f"{timing.delay} samples of delay"


def tolerated_mismatches(
    design: CertifiedDesign, choices: StabilityChoices
) -> tuple[StabilityCertificate, ...]:
    """Continuous certificates of the same design for every box of the mismatch table."""
    loop = design.certificate.loop
    return tuple(
        certify(loop, relative_box(loop, decimal_rational(box), choices.tissue), Continuous())
        for box in choices.mismatch.boxes
    )


def without_projection(scenario: Scenario) -> Scenario:
    """The scenario with the bare law: limits of γ̂ are those of the law itself."""
    return replace(scenario, adaptation=replace(scenario.adaptation, safeguards=()))


def _certified(
    title: str, scenario: Scenario, timing: Timing, box: float, choices: StabilityChoices
) -> CertifiedDesign:
    design = scenario_design(scenario)
    loop = axis_loop(design, [timing.period] if isinstance(timing, Sampling) else ())
    certificate = certify(loop, relative_box(loop, decimal_rational(box), choices.tissue), timing)
    return CertifiedDesign(
        title=title,
        scenario=scenario,
        design=design,
        certificate=certificate,
        share=box,
        gap=_gap(scenario, design, certificate),
    )


def _gap(scenario: Scenario, design: RSTDesign, certificate: StabilityCertificate) -> float:
    plant, timing = design.specification.plant, certificate.timing
    period = to_float(timing.period) if isinstance(timing, Sampling) else None
    step = build_step(
        axis_controller(
            without_projection(scenario),
            design,
            gain=scenario.adaptation.gain,
            sampling_period=period,
        )
    )
    K2, Ks = plant.velocity_gain, plant.stiffness
    loop = (
        build_sampled_axis_loop(
            step,
            velocity_gain=K2,
            stiffness=Ks,
            period=to_float(timing.period),
            delay=timing.delay,
        )
        if isinstance(timing, Sampling)
        else build_axis_loop(step, velocity_gain=K2, stiffness=Ks)
    )
    return certificate_gap(certificate, loop)
