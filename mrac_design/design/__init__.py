"""From a plant and a wanted response to the controller polynomials R, S and T."""

from mrac_design.design.adaptation_scheme import (
    AugmentedError,
    AugmentedErrorUnknownGain,
    DirectError,
)
from mrac_design.design.error_model import (
    ErrorModel,
    relative_degree_two_error_model,
    unfiltered_error_model,
)
from mrac_design.design.factors import integrator, resonator
from mrac_design.design.family import (
    family_member,
    family_member_exact,
    greatest_degree_of_Q,
    smallest_Q,
)
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
    first_order_observer,
    gain_names,
)
from mrac_design.design.symbolic import (
    ClosedForm,
    SensitivityTable,
    integral_rst_closed_form,
    integral_rst_sensitivities,
    rst_closed_form,
    rst_sensitivities,
)
from mrac_design.design.zeros import (
    CancelFactor,
    CancelWellDamped,
    KeepZeros,
    WellDampedRegion,
)

__all__ = [
    "AugmentedError",
    "AugmentedErrorUnknownGain",
    "CancelFactor",
    "CancelWellDamped",
    "ClosedForm",
    "DirectError",
    "ErrorModel",
    "ExactPolynomialDesign",
    "FeedbackLoop",
    "FollowModel",
    "KeepZeros",
    "PolePlacement",
    "PolynomialDesign",
    "RSTDesign",
    "RSTSpecification",
    "ReferenceModel",
    "SensitivityTable",
    "StabilityMargins",
    "UnitStaticGain",
    "WellDampedRegion",
    "design_rst",
    "design_rst_exact",
    "diophantine_system",
    "family_member",
    "family_member_exact",
    "first_order_observer",
    "gain_names",
    "greatest_degree_of_Q",
    "integral_rst_closed_form",
    "integral_rst_sensitivities",
    "integrator",
    "place_poles",
    "place_poles_exact",
    "relative_degree_two_error_model",
    "resonator",
    "rst_closed_form",
    "rst_sensitivities",
    "smallest_Q",
    "stability_margins",
    "unfiltered_error_model",
]
