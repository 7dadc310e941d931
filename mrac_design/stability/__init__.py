"""Stability questions answered exactly: positive realness, hypotheses, certificates.

Nothing here knows how a controller was designed: the judge takes numbers, not designs.
"""

from mrac_design.stability.adaptive_loop import (
    AdaptiveLoop,
    FilterStep,
    adaptive_loop,
    filter_step,
)
from mrac_design.stability.certificate import StabilityCertificate
from mrac_design.stability.certificate_file import (
    certificate_document,
    certificate_schema,
    gains_hash,
    write_certificate,
)
from mrac_design.stability.certification import LargestBox, certify, largest_box
from mrac_design.stability.design_map import DesignMap, design_map
from mrac_design.stability.factorisation import (
    Factorisation,
    FactorisationTable,
    factorisations,
)
from mrac_design.stability.hypotheses import Hypothesis, Status
from mrac_design.stability.parameter_box import ParameterBox, projection_bounds, relative_box
from mrac_design.stability.positive_real import (
    Kind,
    PositiveRealness,
    positive_real,
    strictly_positive_real,
    strongly_strictly_positive_real,
)
from mrac_design.stability.rational_function import RationalFunction, rational_function
from mrac_design.stability.region import (
    RegionGrid,
    SPRCondition,
    candidate_conditions,
    region_on_grid,
    spr_condition,
)
from mrac_design.stability.sampled_loop import Sampling, sampling
from mrac_design.stability.search import search_factorisations
from mrac_design.stability.second_opinion import SecondOpinion, second_opinion
from mrac_design.stability.theorem import (
    TheoremCoverage,
    augmented_error_argument,
    certified_loop,
    feedforward_theorem,
)
from mrac_design.stability.witness import RealPartFactorisation, StorageFunction

__all__ = [
    "AdaptiveLoop",
    "DesignMap",
    "Factorisation",
    "FactorisationTable",
    "FilterStep",
    "Hypothesis",
    "Kind",
    "LargestBox",
    "ParameterBox",
    "PositiveRealness",
    "RationalFunction",
    "RealPartFactorisation",
    "RegionGrid",
    "SPRCondition",
    "Sampling",
    "SecondOpinion",
    "StabilityCertificate",
    "Status",
    "StorageFunction",
    "TheoremCoverage",
    "adaptive_loop",
    "augmented_error_argument",
    "candidate_conditions",
    "certificate_document",
    "certificate_schema",
    "certified_loop",
    "certify",
    "design_map",
    "factorisations",
    "feedforward_theorem",
    "filter_step",
    "gains_hash",
    "largest_box",
    "positive_real",
    "projection_bounds",
    "rational_function",
    "region_on_grid",
    "relative_box",
    "sampling",
    "search_factorisations",
    "second_opinion",
    "spr_condition",
    "strictly_positive_real",
    "strongly_strictly_positive_real",
    "write_certificate",
]
