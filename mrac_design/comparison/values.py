"""The numbers of a comparison as plain data, for values.json and for `--json`."""

from __future__ import annotations

from dataclasses import asdict
from importlib.metadata import version
from typing import Any

from mrac_design.comparison.comparison import Comparison, specification_values
from mrac_design.comparison.findings import claims, findings, pareto_front
from mrac_design.comparison.limit import ASSUMPTIONS
from mrac_design.comparison.store import entry_values, finite


def comparison_values(comparison: Comparison) -> dict[str, Any]:
    """Specification, features, tunings, errors with their intervals, limits and claims."""
    return {
        "mrac_design": version("mrac-design"),
        "specification": specification_values(comparison.specification),
        "conditions": {c.name: c.title for c in comparison.conditions.judged},
        "limit": {
            "assumptions": list(ASSUMPTIONS),
            "conditions": {
                name: {
                    "error_N": limit.error,
                    "motion_error_N": limit.motion_error,
                    "amplification": limit.amplification,
                }
                for name, limit in comparison.limits.items()
            },
        },
        "contestants": {
            contestant.name: {
                "title": contestant.title,
                "family": contestant.family.value,
                "features": asdict(contestant.features),
                "parameters": [parameter.name for parameter in contestant.parameters],
                **entry_values(comparison.entries[contestant.name]),
                "mean_rms_N": _means(comparison, contestant.name),
            }
            for contestant in comparison.contestants
        },
        "front": [contestant.name for contestant in pareto_front(comparison)],
        "claims": [asdict(claim) for claim in claims(comparison)],
        "findings": list(findings(comparison)),
    }


def _means(comparison: Comparison, name: str) -> dict[str, dict[str, float | None]]:
    return {
        condition: {
            "mean": finite(measured.mean),
            "half_width": finite(measured.half_width),
            "over_limit": finite(measured.mean / comparison.limits[condition].error),
        }
        for condition, measured in comparison.entries[name].judgement.conditions.items()
    }
