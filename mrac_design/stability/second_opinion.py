"""python-control's passivity test, beside the exact verdict and never instead of it."""

from __future__ import annotations

from dataclasses import dataclass

import control

from mrac_design.stability.positive_real import PositiveRealness
from mrac_design.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondOpinion:
    """What `control.ispassive` says about positive realness (it does not test strictness)."""

    passive: bool | None
    """Its answer; None when it gave none."""
    note: str
    """Why there is no answer, or how it compares with the exact verdict."""


def second_opinion(judged: PositiveRealness) -> SecondOpinion:
    """Ask python-control whether G is passive, and compare with the exact verdict.

    The semidefinite program behind it has a tolerance and its status is not looked at there, so
    agreement is reassuring and disagreement is no proof of anything.
    """
    try:
        passive = bool(control.ispassive(judged.function.transfer_function()))
    except ModuleNotFoundError:
        return SecondOpinion(passive=None, note="needs the package cvxopt")
    # The solver fails in several undocumented ways, and no answer is an answer here.
    except Exception as error:
        return SecondOpinion(passive=None, note=f"no answer: {error}")
    agrees = passive == (judged.verdict is Verdict.PROVED)
    note = "agrees" if agrees else f"differs from the exact '{judged.kind.value}' verdict"
    return SecondOpinion(passive=passive, note=note)
