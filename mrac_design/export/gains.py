"""Controller gains as JSON, with units and a hash that ties them to their design."""

from __future__ import annotations

import hashlib
import json
from typing import Any

from mrac_design.controller.adaptive import GAIN_NAMES
from mrac_design.design import RSTDesign
from mrac_design.simulation.scenario import Scenario

_UNITS = ("1/s", "m/(N·s)", "m/(N·s²)", "m/(N·s)", "m/(N·s²)")


def gains_document(scenario: Scenario, design: RSTDesign) -> dict[str, Any]:
    """Everything a robot needs to run the controller of `scenario`, as plain data.

    `gains` holds θ in SI units with r1 itself (the adapted r1' is r1 − ao); `hash` is the SHA-256
    of the rest in canonical JSON, so an edited file is noticed.
    """
    adaptation, choice = scenario.adaptation, scenario.design
    document: dict[str, Any] = {
        "format": "mrac_design gains 1",
        "scenario": scenario.name,
        "plant": {
            "stiffness": _quantity(choice.stiffness, "N/m"),
            "velocity_gain": _quantity(choice.velocity_gain, "1/s"),
        },
        "reference_model": {
            "bandwidth": _quantity(choice.bandwidth, "rad/s"),
            "damping": _quantity(choice.damping, "1"),
        },
        "observer_pole": _quantity(choice.observer_pole, "rad/s"),
        "prefilter": {
            "bandwidth": _quantity(scenario.prefilter.bandwidth, "rad/s"),
            "damping": _quantity(scenario.prefilter.damping, "1"),
        },
        "gains": {
            name: _quantity(value, unit)
            for name, value, unit in zip(
                ("r1", "s0", "s1", "t0", "t1"),
                (design.r1, design.s0, design.s1, design.t0, design.t1),
                _UNITS,
                strict=True,
            )
        },
        "scaling": {
            name: _quantity(value, unit)
            for name, value, unit in zip(GAIN_NAMES[:5], design.scaling, _UNITS, strict=True)
        },
        "adaptation": {
            "law": adaptation.law,
            "gain": _quantity(adaptation.gain, "1" if adaptation.law == "normalised" else "1/N²"),
            "normalisation": _quantity(adaptation.normalisation, "N²"),
            "bias_force": _quantity(adaptation.bias_force, "N"),
        },
    }
    return {**document, "hash": document_hash(document)}


def document_hash(document: dict[str, Any]) -> str:
    """SHA-256 of the document without its `hash`, in canonical JSON."""
    content = {key: value for key, value in document.items() if key != "hash"}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _quantity(value: float, unit: str) -> dict[str, Any]:
    return {"value": float(value), "unit": unit}
