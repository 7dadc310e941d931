"""Where a scenario goes beyond [Z]: tissue, friction, measurement, safeguards of the law."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mrac_design.motion import StepSequence
from mrac_design.motion.heart import Origin
from mrac_design.report.tables import Quantity
from mrac_design.simulation.safeguards import safeguard_entries
from mrac_design.simulation.sampling_choices import SampledMeasurement
from mrac_design.simulation.scenario import AdaptationChoice, Scenario
from mrac_design.time_domain import Continuous

_BEYOND_PAPER = "not in [Z]"


def tissue_and_friction(scenario: Scenario) -> tuple[Quantity, ...]:
    """Tissue beside its stiffness, and friction of the joints."""
    assumed = Origin.ASSUMED.value
    contact, friction = scenario.contact, scenario.friction
    pulls = contact.kind == "two_sided"
    quantities = [
        Quantity(
            "contact",
            "spring that also pulls" if pulls else "one-sided: the tissue cannot pull",
            "published" if pulls else assumed,
            "stated in [Z]" if pulls else "[Z]: a spring that also pulls",
        )
    ]
    if contact.damping:
        quantities.append(
            Quantity("damping of the tissue", f"{contact.damping:g} N·s/m", assumed, _BEYOND_PAPER)
        )
    if contact.stiffness_factor.levels != (1.0,):
        factor = _steps(contact.stiffness_factor, 1.0, "")
        quantities.append(Quantity("factor on $K_s$", factor, assumed, _BEYOND_PAPER))
    if contact.retreat.levels != (0.0,):
        retreat = _steps(contact.retreat, 1e3, " mm")
        quantities.append(Quantity("retreat of the surface", retreat, assumed, _BEYOND_PAPER))
    quantities.append(
        Quantity("friction of the joints", "none", "published", "[Z 1] has no friction")
        if friction.scale == 0
        else Quantity(
            "friction of the joints",
            f"{friction.scale:g} × the robot file's, smoothed over {1e3 * friction.slide_width:g} "
            f"mm/s and {1e3 * friction.turn_width:g} mrad/s",
            assumed,
            "[Z 1] has no friction",
        )
    )
    return tuple(quantities)


def measurement(sampling: Continuous | SampledMeasurement) -> tuple[Quantity, ...]:
    """When and how the controller measures."""
    if isinstance(sampling, Continuous):
        remark = "the laws of [Z] are in continuous time"
        return (Quantity("sampling", "none; everything is measured exactly", "published", remark),)
    assumed, sensor, encoder = Origin.ASSUMED.value, sampling.force_sensor, sampling.encoder
    reading = [f"noise {1e3 * sensor.noise:g} mN", f"steps of {1e3 * sensor.resolution:g} mN"]
    if sensor.bias:
        reading.append(f"bias {1e3 * sensor.bias:g} mN")
    if sensor.decimation > 1:
        reading.append(f"a reading every {sensor.decimation} samples")
    if sensor.mode_frequency:
        reading.append(f"mode at {sensor.mode_frequency:g} Hz, ζ = {sensor.mode_damping:g}")
    joints = (
        f"{encoder.counts_per_turn:.0f} counts a turn, velocity low-pass "
        f"{encoder.velocity_cutoff:g} rad/s"
        if encoder.counts_per_turn
        else "exact"
    )
    return (
        Quantity(
            "sampling",
            f"{sampling.rate:g} Hz, {sampling.delay} sample(s) of delay",
            assumed,
            _BEYOND_PAPER,
        ),
        Quantity("force sensor", ", ".join(reading), assumed, "an ATI Mini40 in [Z], no figures"),
        Quantity("joint sensors", joints, assumed, _BEYOND_PAPER),
    )


def law_extras(adaptation: AdaptationChoice) -> tuple[Quantity, ...]:
    """What the law has that that of [Z] has not."""
    quantities = []
    if adaptation.bias_force:
        quantities.append(("constant regressor", f"{adaptation.bias_force:g} N"))
    if adaptation.safeguards:
        words = [
            f"{entry['kind'].replace('_', ' ')} ({_numbers(entry)})"
            for entry in safeguard_entries(adaptation.safeguards)
        ]
        quantities.append(("safeguards of the law", ", ".join(words)))
    return tuple(
        Quantity(name, value, Origin.ASSUMED.value, _BEYOND_PAPER) for name, value in quantities
    )


def _numbers(entry: Mapping[str, Any]) -> str:
    return ", ".join(f"{key} {value:g}" for key, value in entry.items() if key != "kind")


def _steps(steps: StepSequence, scale: float, unit: str) -> str:
    """A step sequence in words: levels with the instants from which they hold."""
    return ", ".join(
        f"{scale * level:g}{unit} from {time:g} s"
        for time, level in zip(steps.times, steps.levels, strict=True)
    )
