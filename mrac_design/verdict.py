"""The three possible outcomes of a mathematical question put to this package."""

from __future__ import annotations

from enum import Enum


class Verdict(Enum):
    """A verdict is a value: a question may be settled either way, or stay open."""

    PROVED = "proved"
    REFUTED = "refuted"
    UNDECIDED = "undecided"
