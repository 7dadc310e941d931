"""A tuned controller as readable formulas: one LaTeX document with every number in it.

Composed in Markdown from what designs and robots say of themselves, then set by Pandoc.
"""

from __future__ import annotations

from pathlib import Path

import pypandoc

from mrac_design.controller.adaptation import AdaptationLaw, GradientLaw, NormalisedGradientLaw
from mrac_design.controller.reference import DirectReference
from mrac_design.controller.robust import (
    WithDeadZone,
    WithErrorLeakage,
    WithLeakage,
    WithProjection,
)
from mrac_design.design import (
    AugmentedError,
    ClosedForm,
    RSTSpecification,
    design_rst_exact,
    diophantine_system,
    integral_rst_closed_form,
    rst_closed_form,
    unfiltered_error_model,
)
from mrac_design.errors import ParameterError, RenderingError
from mrac_design.export.gain_document import document_of
from mrac_design.export.gain_set import GainSet
from mrac_design.export.writing import written_whole
from mrac_design.polynomials.rationals import polynomial_latex
from mrac_design.robot import RobotDescription

_LINEARISATION = r"""
$$\begin{aligned}
f^* &= u - K_2 \dot X \\
\ddot q^* &= J^{-1} (f^* - \dot J \dot q) \\
\Gamma &= \hat M(q)\,\ddot q^* + \hat V(q, \dot q) + \hat G(q) + J^T F_e
\end{aligned}$$
"""

_INTERNAL_MODEL_ERROR = r"""
$$\begin{aligned}
u &= -\tfrac{K}{A_o} u - \theta^T (P_1 \varphi) \\
P_1 \varphi
  &= \tfrac{1}{A_o} (D u,\; p^DEGREE y,\; \ldots,\; y,\; -p^DEGREE u_c,\; \ldots,\; -u_c)^T \\
\eta &= -\left(\tfrac{(p + c) D}{P_1 A_o} u + \varphi^T \theta\right) \\
\varepsilon &= (y - y_m) + b_0 \eta
\end{aligned}$$
"""


def write_formulas(gains: GainSet, robot: RobotDescription, path: Path) -> None:
    """Write the controller's formulas as a LaTeX document of its own (any TeX engine).

    The file appears whole or not at all. Raises RenderingError when Pandoc
    refuses, FileError when the file cannot be written.
    """
    try:
        text = pypandoc.convert_text(
            formulas_markdown(gains, robot),
            "latex",
            format="markdown-yaml_metadata_block",
            extra_args=[
                "--standalone",
                f"--metadata=title:Adaptive RST force controller, {gains.scenario}",
                "--variable=geometry:margin=2cm",
            ],
        )
    except RuntimeError as problem:
        raise RenderingError(str(path), str(problem)) from problem
    with written_whole(path) as staged:
        staged.write_text(text, encoding="utf-8")


def formulas_markdown(gains: GainSet, robot: RobotDescription) -> str:
    """The same content in Markdown with LaTeX formulas."""
    return "\n\n".join(
        (
            f"Made by mrac_design {gains.package_version}; gains `{document_of(gains)['hash']}`, "
            f"robot file {gains.robot.file} `{gains.robot.sha256}`.",
            *_loop(gains),
            *_diophantine(gains),
            *_adaptation(gains),
            "# Linearising torque",
            _LINEARISATION.strip(),
            f"with $K_2 = {gains.specification.plant.velocity_gain:.10g}$ 1/s, the hats being the "
            f"robot below, its bodies times {gains.robot_model.body_scale:.10g} and the row of its "
            f"first joint times {gains.robot_model.first_joint_scale:.10g}. Other components of "
            f"the task: critically damped PD of {gains.tool_axis_bandwidth:.10g} rad/s.",
            "# Robot",
            robot._repr_markdown_(),
        )
    )


def _loop(gains: GainSet) -> tuple[str, ...]:
    model, prefilter = gains.specification.reference_model, gains.prefilter
    desired = "F_d = r" if prefilter is None else f"F_d = {_bare(prefilter)}\\,r"
    if gains.feedforward == DirectReference():
        entering = "u_c = F_d"
    else:
        c1, c2 = gains.feedforward.weights(model)
        entering = f"u_c = F_d + {_number(c1)}\\,\\dot F_d + {_number(c2)}\\,\\ddot F_d"
    return (
        "# Control law of a force axis",
        "$$R\\,u = T\\,u_c - S\\,y$$",
        _display(gains.design._repr_latex_()),
        "$y$ the force (N), $u$ the commanded acceleration (m/s²). Plant, reference and its model:",
        _display(gains.specification.plant._repr_latex_()),
        f"$${desired}, \\qquad {entering}$$",
        f"$$y_m = {_bare(model)}\\,u_c$$",
    )


def _diophantine(gains: GainSet) -> tuple[str, ...]:
    specification = gains.specification
    closed = _closed_form(specification)
    return (
        "# Diophantine equation",
        "$$A R + b_0 S = A_o A_m, \\qquad R = (p + r_1) D, \\qquad "
        "T = \\tfrac{\\omega^2}{b_0} A_o$$",
        f"$$A_o = {polynomial_latex(specification.observer, 'p')}, \\qquad "
        f"D = {polynomial_latex(specification.internal_model, 'p')}, \\qquad "
        f"r_1 = {_number(gains.design.r1)}$$",
        _display(diophantine_system(specification)._repr_latex_()),
        *(() if closed is None else ("Solved in letters:", _display(closed._repr_latex_()))),
        f"Residual of the numbers above: {gains.design.residual:.2g} of $A_o A_m$.",
    )


def _closed_form(specification: RSTSpecification) -> ClosedForm | None:
    """The coefficients in letters, where the package has derived them."""
    if specification.degree == 1:
        return rst_closed_form()
    return integral_rst_closed_form() if specification.internal_model == (1.0, 0.0) else None


def _adaptation(gains: GainSet) -> tuple[str, ...]:
    scaling = ", ".join(_number(value) for value in gains.design.scaling)
    start = ", ".join(_number(value) for value in gains.initial_gains)
    bias = (
        f"The constant regressor is {gains.bias_force:.10g} N."
        if gains.bias_force > 0
        else "There is no constant regressor."
    )
    return (
        "# Adaptation",
        *_error_model(gains.specification),
        "In scaled gains $\\theta = \\Sigma \\hat\\theta$, $\\hat\\varphi = b_0 \\Sigma \\varphi$:",
        f"$$\\Sigma = \\mathrm{{diag}}({scaling}), \\qquad \\hat\\theta(0) = ({start})^T$$",
        *law_formulas(gains.law),
        bias,
    )


def _error_model(specification: RSTSpecification) -> tuple[str, ...]:
    if specification.degree == 1:
        model = unfiltered_error_model(design_rst_exact(specification))
        return (
            _display(AugmentedError(model=model)._repr_latex_()),
            "with $Q = A_o A_m$, $P_1 = A_m$, $P_2 = A_o$.",
        )
    return (
        _INTERNAL_MODEL_ERROR.replace("DEGREE", f"{{{specification.degree}}}").strip(),
        f"with $P_1 = A_m$, $K = (p + c) D - A_o$ and $c = {_number(specification.adapted_pole)}$; "
        "the first entry of $\\theta$ is $r_1 - c$.",
    )


def law_formulas(law: AdaptationLaw) -> tuple[str, ...]:
    """An adaptation law as Markdown paragraphs, the innermost first; scaled quantities.

    Raises ParameterError for a law that has no formula here.
    """
    match law:
        case GradientLaw():
            rate = f"{_gain(law.gain)}\\,\\omega\\,\\hat\\varphi\\,\\varepsilon"
            return (f"$$\\dot{{\\hat\\theta}} = {rate}$$",)
        case NormalisedGradientLaw():
            rate = (
                f"{_gain(law.gain)}\\,\\frac{{\\omega\\,\\hat\\varphi\\,\\varepsilon}}"
                f"{{{_number(law.alpha)} + \\hat\\varphi^T\\hat\\varphi}}"
            )
            return (f"$$\\dot{{\\hat\\theta}} = {rate}$$",)
        case WithProjection():
            limits = ", ".join(
                f"[{_number(low)}, {_number(high)}]"
                for low, high in zip(law.box.lower, law.box.upper, strict=True)
            )
            own = f"Projected, so that the scaled gains stay in ${limits}$."
        case WithDeadZone():
            own = (
                "$\\varepsilon$ is replaced by $\\varepsilon - "
                f"\\mathrm{{clip}}(\\varepsilon, \\pm {_number(law.width)})$."
            )
        case WithLeakage() | WithErrorLeakage():
            factor = "" if isinstance(law, WithLeakage) else "|\\varepsilon|\\,"
            centre = ", ".join(_number(value) for value in law.centre)
            own = (
                f"Minus the leakage ${_number(law.leakage)}\\,{factor}(\\hat\\theta - ({centre}))$."
            )
        case _:
            raise ParameterError("adaptation law", type(law).__name__, "has no formula here")
    return (*law_formulas(law.law), own)


def _gain(gain: float | tuple[float, ...]) -> str:
    if isinstance(gain, tuple):
        return f"\\mathrm{{diag}}({', '.join(_number(value) for value in gain)})"
    return _number(gain)


def _number(value: float) -> str:
    """A number for a formula, in ten digits."""
    if value in (float("inf"), float("-inf")):
        return "\\infty" if value > 0 else "-\\infty"
    mantissa, _, exponent = f"{value:.10g}".partition("e")
    return f"{mantissa} \\cdot 10^{{{int(exponent)}}}" if exponent else mantissa


def _bare(latex: object) -> str:
    return latex._repr_latex_().strip("$")  # type: ignore[attr-defined]


def _display(latex: str) -> str:
    return f"$${latex.strip('$')}$$"
