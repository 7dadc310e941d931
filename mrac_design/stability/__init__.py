"""Stability questions answered exactly: positive realness, hypotheses, certificates.

Nothing here knows how a controller was designed: the judge takes numbers, not designs.
"""

from mrac_design.stability.factorisation import (
    Factorisation,
    FactorisationTable,
    factorisations,
)
from mrac_design.stability.hypotheses import Hypothesis, Status
from mrac_design.stability.positive_real import (
    Kind,
    PositiveRealness,
    positive_real,
    strictly_positive_real,
    strongly_strictly_positive_real,
)
from mrac_design.stability.rational_function import RationalFunction, rational_function
from mrac_design.stability.second_opinion import SecondOpinion, second_opinion
from mrac_design.stability.theorem import (
    TheoremCoverage,
    augmented_error_argument,
    feedforward_theorem,
)

__all__ = [
    "Factorisation",
    "FactorisationTable",
    "Hypothesis",
    "Kind",
    "PositiveRealness",
    "RationalFunction",
    "SecondOpinion",
    "Status",
    "TheoremCoverage",
    "augmented_error_argument",
    "factorisations",
    "feedforward_theorem",
    "positive_real",
    "rational_function",
    "second_opinion",
    "strictly_positive_real",
    "strongly_strictly_positive_real",
]
