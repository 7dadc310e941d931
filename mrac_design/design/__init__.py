"""From a plant and a wanted response to the controller polynomials R, S and T."""

from mrac_design.design.loop import FeedbackLoop
from mrac_design.design.margins import StabilityMargins, stability_margins
from mrac_design.design.pole_placement import FollowModel, PolePlacement, UnitStaticGain
from mrac_design.design.polynomial_design import (
    ExactPolynomialDesign,
    PolynomialDesign,
    place_poles,
    place_poles_exact,
)
from mrac_design.design.reference_model import ReferenceModel
from mrac_design.design.rst import (
    RSTDesign,
    RSTSpecification,
    design_rst,
    design_rst_exact,
    diophantine_system,
)
from mrac_design.design.zeros import (
    CancelFactor,
    CancelWellDamped,
    KeepZeros,
    WellDampedRegion,
)

__all__ = [
    "CancelFactor",
    "CancelWellDamped",
    "ExactPolynomialDesign",
    "FeedbackLoop",
    "FollowModel",
    "KeepZeros",
    "PolePlacement",
    "PolynomialDesign",
    "RSTDesign",
    "RSTSpecification",
    "ReferenceModel",
    "StabilityMargins",
    "UnitStaticGain",
    "WellDampedRegion",
    "design_rst",
    "design_rst_exact",
    "diophantine_system",
    "place_poles",
    "place_poles_exact",
    "stability_margins",
]
