"""What enters a scenario's loop from outside: heart, force reference, sensor noise, retreat."""

from __future__ import annotations

from collections.abc import Sequence

from mrac_design.arrays import FloatArray
from mrac_design.motion import HeartMotion
from mrac_design.motion.signal import PiecewisePolynomial, stack
from mrac_design.simulation.contact import retreating
from mrac_design.simulation.sampling_choices import SampledMeasurement
from mrac_design.simulation.scenario import Scenario


def scenario_inputs(
    scenario: Scenario, motion: HeartMotion, *, axes: Sequence[int], tip: FloatArray
) -> PiecewisePolynomial:
    """Heart position (m), force reference (N), k channels each, and what else the loop takes.

    `axes` are the components of the motion that are force axes, `tip` is the tip at home (m),
    shape (k,): the heart lies where the tissue carries the first reference with the tip there, so
    the run starts in equilibrium but for the heart's velocity. The surface's own steps are added
    to the heart; a sampled loop also gets the sensor's noise and bias; what the contact needs
    comes last.
    """
    sampling, duration = scenario.sampling, scenario.simulation.duration
    displacement = motion.displacement.restricted(0.0, duration).selected(axes)
    rest = tip - rest_depth(scenario, scenario.stiffness)
    heart = displacement.shifted(rest - displacement(0.0)[:, 0])
    if scenario.contact.retreat.levels != (0.0,):
        heart = retreating(heart, scenario.contact.retreat)
    signals = [heart, scenario.reference.piecewise(duration)]
    if isinstance(sampling, SampledMeasurement):
        signals.append(
            sampling.force_sensor.errors(
                axes=heart.channels, period=sampling.domain.period, duration=duration
            )
        )
    return stack(*signals, *scenario.contact.build(scenario.stiffness).exogenous(heart))


def rest_depth(scenario: Scenario, stiffness: float) -> FloatArray:
    """Depth at which tissue of `stiffness` (N/m) carries the first reference (m), shape (k,)."""
    return scenario.contact.build(stiffness).rest_depth(scenario.reference.initial)
