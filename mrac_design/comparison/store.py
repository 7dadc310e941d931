"""Finished results on disk, one file a contestant, so that an interrupted comparison goes on."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mrac_design.arrays import readonly
from mrac_design.comparison.judging import Judgement, Measured
from mrac_design.comparison.tuning import Tuning
from mrac_design.publishing import publish_file, staging_folder


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Entry:
    """What is known of one contestant when it is finished."""

    tuning: Tuning
    """What the tuner found."""
    judgement: Judgement
    """How it did."""


@dataclass(frozen=True, slots=True)
class ComparisonStore:
    """A folder of finished contestants."""

    folder: Path
    """Where the files lie; it need not exist yet."""

    def read(self, name: str, fingerprint: str) -> Entry | None:
        """The finished contestant `name`, None when there is none of this fingerprint."""
        try:
            content = json.loads((self.folder / f"{name}.json").read_text(encoding="utf-8"))
            return _entry(content) if content["fingerprint"] == fingerprint else None
        except (OSError, ValueError, KeyError, TypeError):
            return None  # absent or damaged: computed anew

    def write(self, name: str, fingerprint: str, entry: Entry) -> None:
        """Keep a finished contestant; the file appears whole or not at all."""
        target = self.folder / f"{name}.json"
        text = json.dumps({"fingerprint": fingerprint, **entry_values(entry)}, indent=2)
        with staging_folder(target) as folder:
            staged = folder / target.name
            staged.write_text(text + "\n", encoding="utf-8")
            publish_file(staged, target)


def entry_values(entry: Entry) -> dict[str, Any]:
    """A finished contestant as plain data; null stands for a loop that diverged."""
    tuning, judgement = entry.tuning, entry.judgement
    return {
        "tuning": {
            "values": tuning.values.tolist(),
            "error_N": tuning.error,
            "delayed_error_N": tuning.delayed_error,
            "proved": tuning.proved,
            "admissible": tuning.admissible,
            "evaluations": tuning.evaluations,
        },
        "motion_error_N": finite(judgement.motion_error),
        "amplification": finite(judgement.amplification),
        "conditions": {
            name: {
                "rms_N": [finite(value) for value in measured.rms],
                "largest_N": [finite(value) for value in measured.largest],
            }
            for name, measured in judgement.conditions.items()
        },
    }


def finite(value: float) -> float | None:
    """The number, or None where there is none: JSON has no infinity."""
    return float(value) if math.isfinite(value) else None


def _entry(content: Mapping[str, Any]) -> Entry:
    tuning = content["tuning"]
    return Entry(
        tuning=Tuning(
            values=readonly(tuning["values"]),
            error=tuning["error_N"],
            delayed_error=tuning["delayed_error_N"],
            proved=tuning["proved"],
            admissible=tuning["admissible"],
            evaluations=tuning["evaluations"],
        ),
        judgement=Judgement(
            conditions={
                name: Measured(
                    rms=readonly([_number(value) for value in measured["rms_N"]]),
                    largest=readonly([_number(value) for value in measured["largest_N"]]),
                )
                for name, measured in content["conditions"].items()
            },
            motion_error=_number(content["motion_error_N"]),
            amplification=_number(content["amplification"]),
        ),
    )


def _number(value: float | None) -> float:
    return math.inf if value is None else float(value)
