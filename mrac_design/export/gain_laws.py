"""Adaptation laws as plain data and back, wrappers included."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from typing import Any

from mrac_design.controller.adaptation import AdaptationLaw, GradientLaw, NormalisedGradientLaw
from mrac_design.controller.robust import (
    GainBox,
    WithDeadZone,
    WithErrorLeakage,
    WithLeakage,
    WithProjection,
)
from mrac_design.errors import ParameterError

_OPEN = sys.float_info.max
"""Stands for no limit: not every format can hold an infinity."""


def quantity(value: float, unit: str) -> dict[str, Any]:
    """A number with its unit."""
    return {"value": float(value), "unit": unit}


def quantities(values: tuple[float, ...], unit: str) -> dict[str, Any]:
    """A list of numbers with their unit."""
    return {"values": [float(value) for value in values], "unit": unit}


def law_document(law: AdaptationLaw) -> dict[str, Any]:
    """A law as nested plain data, the law inside a wrapper under `inside`.

    Raises ParameterError for a law that has no form in a file.
    """
    match law:
        case GradientLaw():
            return {"law": "gradient", "gain": _gain(law.gain, "1/N²")}
        case NormalisedGradientLaw():
            return {
                "law": "normalised",
                "gain": _gain(law.gain, "1"),
                "normalisation": quantity(law.alpha, "N²"),
            }
        case WithProjection():
            own = {
                "law": "projection",
                "lower": quantities(_written(law.box.lower), "1"),
                "upper": quantities(_written(law.box.upper), "1"),
            }
        case WithDeadZone():
            own = {"law": "dead_zone", "width": quantity(law.width, "N")}
        case WithLeakage():
            own = {
                "law": "leakage",
                "leakage": quantity(law.leakage, "1/s"),
                "centre": quantities(law.centre, "1"),
            }
        case WithErrorLeakage():
            own = {
                "law": "error_leakage",
                "leakage": quantity(law.leakage, "1/(N·s)"),
                "centre": quantities(law.centre, "1"),
            }
        case _:
            raise ParameterError("adaptation law", type(law).__name__, "has no form in a file")
    return {**own, "inside": law_document(law.law)}


def law_of(document: Mapping[str, Any]) -> AdaptationLaw:
    """The law a document describes, whose structure has been checked.

    Raises ParameterError for numbers no law can have.
    """
    name = document["law"]
    if name == "gradient":
        return GradientLaw(gain=_read_gain(document["gain"]))
    if name == "normalised":
        return NormalisedGradientLaw(
            gain=_read_gain(document["gain"]), alpha=document["normalisation"]["value"]
        )
    inside = law_of(document["inside"])
    if name == "dead_zone":
        return WithDeadZone(law=inside, width=document["width"]["value"])
    if name == "projection":
        lower, upper = (_limits(document[side]["values"]) for side in ("lower", "upper"))
        return WithProjection(law=inside, box=GainBox(lower=lower, upper=upper))
    leaking = WithLeakage if name == "leakage" else WithErrorLeakage
    return leaking(
        law=inside,
        leakage=document["leakage"]["value"],
        centre=tuple(document["centre"]["values"]),
    )


def _gain(gain: float | tuple[float, ...], unit: str) -> dict[str, Any]:
    return quantities(gain, unit) if isinstance(gain, tuple) else quantity(gain, unit)


def _read_gain(document: Mapping[str, Any]) -> float | tuple[float, ...]:
    return tuple(document["values"]) if "values" in document else document["value"]


def _written(limits: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(math.copysign(_OPEN, x) if math.isinf(x) else x for x in limits)


def _limits(values: list[float]) -> tuple[float, ...]:
    return tuple(math.copysign(math.inf, x) if abs(x) == _OPEN else x for x in values)
