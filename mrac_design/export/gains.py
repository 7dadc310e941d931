"""Gains of a tuned controller: the value, its documents and its files, under one name.

gains = read_gains(Path("gains.yaml"))
step = build_step(controller_of(gains, Discrete(1e-3)))
"""

from __future__ import annotations

from typing import Any

from mrac_design.design import RSTDesign
from mrac_design.export.gain_document import document_hash, document_of, gains_schema_path
from mrac_design.export.gain_formats import read_gains, require_gains_suffix, write_gains
from mrac_design.export.gain_set import (
    GainSet,
    controller_of,
    gain_set,
    require_robot,
    robot_step_of,
)
from mrac_design.simulation.scenario import Scenario
from mrac_design.study import VARIANTS, Variant

__all__ = [
    "GainSet",
    "controller_of",
    "document_hash",
    "document_of",
    "gain_set",
    "gains_document",
    "gains_schema_path",
    "read_gains",
    "require_gains_suffix",
    "require_robot",
    "robot_step_of",
    "write_gains",
]


def gains_document(
    scenario: Scenario, design: RSTDesign, variant: Variant = VARIANTS[-1]
) -> dict[str, Any]:
    """The gains of a study's controller as plain data, with units.

    `hash` is the SHA-256 of the rest in canonical JSON: it tells one set of gains from another.
    """
    return document_of(gain_set(scenario, design, variant))
