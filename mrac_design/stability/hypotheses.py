"""One hypothesis of a theorem, with how far it holds and the evidence."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum


class Status(Enum):
    """How far a hypothesis is known to hold."""

    PROVED = "proved"
    """Follows by exact computation from the data."""
    CHECKED = "checked"
    """Seen to hold in a computation that is no proof."""
    ASSUMED = "assumed"
    """Taken for granted; nothing in the data speaks for or against it."""
    VIOLATED = "violated"
    """Does not hold; the evidence says where."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hypothesis:
    """A hypothesis, its status and why."""

    name: str
    """What must hold, as a short clause."""
    status: Status
    """How far it holds."""
    evidence: str
    """A plain sentence with the number that decides."""

    @property
    def holds(self) -> bool:
        """False when the hypothesis is violated."""
        return self.status is not Status.VIOLATED


def decided(name: str, holds: bool, evidence: str) -> Hypothesis:
    """A hypothesis settled by exact computation, one way or the other."""
    status = Status.PROVED if holds else Status.VIOLATED
    return Hypothesis(name=name, status=status, evidence=evidence)


def first_violated(hypotheses: Iterable[Hypothesis]) -> Hypothesis | None:
    """The first hypothesis that does not hold, None when all do."""
    return next((item for item in hypotheses if not item.holds), None)


def hypotheses_markdown(hypotheses: Iterable[Hypothesis]) -> str:
    """Markdown table of hypotheses."""
    rows = "\n".join(
        f"| {table_cell(item.name)} | {item.status.value} | {table_cell(item.evidence)} |"
        for item in hypotheses
    )
    return f"| hypothesis | status | evidence |\n|---|---|---|\n{rows}"


def table_cell(text: str) -> str:
    """Text with the bars escaped that would end a table cell."""
    return text.replace("|", "\\|")
