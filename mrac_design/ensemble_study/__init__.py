"""Thousands of runs of a scenario over what nobody knows exactly: tissue, robot, gain, motion.

choice → preparation → running → record.
"""

from mrac_design.ensemble_study.choice import EnsembleChoice
from mrac_design.ensemble_study.preparation import PreparedEnsemble, prepare_ensemble
from mrac_design.ensemble_study.record import EnsembleRecord
from mrac_design.ensemble_study.running import run_prepared

__all__ = [
    "EnsembleChoice",
    "EnsembleRecord",
    "PreparedEnsemble",
    "prepare_ensemble",
    "run_prepared",
]
