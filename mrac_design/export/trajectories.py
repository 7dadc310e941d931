"""Simulated runs as NumPy archives, one a variant, beside the study's values."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from mrac_design.export.values import study_values
from mrac_design.publishing import publish_file, staging_folder
from mrac_design.study import StudyRecord


def write_trajectories(study: StudyRecord, directory: Path) -> None:
    """Write `values.json` and `<variant>.npz` (time and every signal) into `directory`.

    Each file appears whole or not at all. Units stand in the archive's `units` entry as JSON,
    events in `event_time` (s) and `event`.
    """
    with staging_folder(directory) as staging:
        staged = []
        for variant, trajectory in study.trajectories.items():
            units = {n: signal.unit for n, signal in trajectory.signals.items()}
            units |= {"time": "s", "event_time": "s"}
            arrays: dict[str, Any] = {n: s.values for n, s in trajectory.signals.items()}
            arrays |= {"time": trajectory.time, "units": json.dumps(units)}
            arrays |= {
                "event_time": np.array([event.time for event in trajectory.events]),
                "event": np.array([f"{e.event.name} {e.change}" for e in trajectory.events], "U"),
            }
            file = staging / f"{variant}.npz"
            np.savez_compressed(file, allow_pickle=False, **arrays)
            staged.append(file)
        values = staging / "values.json"
        text = json.dumps(study_values(study), indent=2, ensure_ascii=False)
        values.write_text(text + "\n", encoding="utf-8")
        for file in (*staged, values):
            publish_file(file, directory / file.name)
