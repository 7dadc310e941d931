"""The LaTeX document: every number in it, readable by a parser of LaTeX."""

from __future__ import annotations

import re
from dataclasses import replace

import pypandoc
import pytest

from mrac_design.controller.adaptation import GradientLaw, NormalisedGradientLaw
from mrac_design.controller.reference import DirectReference
from mrac_design.controller.robust import (
    GainBox,
    WithDeadZone,
    WithErrorLeakage,
    WithLeakage,
    WithProjection,
)
from mrac_design.design import design_rst
from mrac_design.errors import FileError, ParameterError
from mrac_design.export.formulas import formulas_markdown, law_formulas, write_formulas
from mrac_design.export.gains import document_of
from mrac_design.robot import load_robot
from tests.export.gain_sets import internal_model_gain_set, nominal_gain_set

ROBOT = load_robot("d2m2_set_a")


def test_the_document_is_latex_with_every_number(tmp_path):
    gains = nominal_gain_set()
    path = tmp_path / "formulas.tex"
    write_formulas(gains, ROBOT, path)
    text = path.read_text("utf-8")
    assert text.startswith("% Options") or text.startswith("\\")
    assert r"\begin{document}" in text
    for value in gains.coefficients:
        assert f"{value:.6g}" in text, value
    for value in (*gains.initial_gains, *gains.design.scaling):
        assert f"{value:.6g}" in text, value
    for joint in ROBOT.joints:
        assert joint.name in text
    assert document_of(gains)["hash"] in re.sub(r"\s", "", text)
    # A parser of LaTeX reads it: balanced environments and braces, tables, formulas.
    again = pypandoc.convert_text(text, "markdown", format="latex")
    assert again.count("$$") >= 20
    assert r"\begin{pmatrix}" in again
    assert [path.name for path in tmp_path.iterdir()] == ["formulas.tex"]


def test_an_internal_model_is_in_the_formulas(tmp_path):
    gains = internal_model_gain_set()
    text = formulas_markdown(gains, ROBOT)
    assert "D = p^{2} + 10\\,p + 1400" in text
    assert "A_o = p^{3} + 500\\,p^{2} + 90000\\,p" in text
    assert "c = 490$" in text  # (p + 490) D begins like Ao
    assert "p^{3} y" in text
    assert "Solved in letters" not in text
    for value in (gains.coefficients[0], *gains.initial_gains, *gains.design.scaling):
        assert f"{value:.10g}".partition("e")[0] in text, value
    for value in gains.coefficients[1:]:
        assert f"{value:.6g}".partition("e")[0] in text, value
    write_formulas(gains, ROBOT, tmp_path / "formulas.tex")
    integral = replace(
        gains.specification, observer=(1.0, 400.0, 90000.0), internal_model=(1.0, 0.0)
    )
    design = design_rst(integral)
    lettered = replace(
        gains,
        specification=integral,
        coefficients=tuple(value for _, value, _ in design.coefficients),
        initial_gains=tuple(design.scaled_parameters.tolist()),
    )
    assert r"\alpha_2" in formulas_markdown(lettered, ROBOT)


def test_what_is_switched_off_is_said_to_be():
    gains = replace(nominal_gain_set(), prefilter=None, feedforward=DirectReference())
    text = formulas_markdown(gains, ROBOT)
    assert "F_d = r," in text
    assert "u_c = F_d$$" in text
    assert "no constant regressor" in text
    assert "2.5 N" in formulas_markdown(replace(gains, bias_force=2.5), ROBOT)


@pytest.mark.parametrize(
    ("law", "names"),
    [
        (lambda law: law, "0.25 +"),
        (lambda law: GradientLaw(gain=(1.0, 2.0)), r"\mathrm{diag}(1, 2)"),
        (lambda law: WithDeadZone(law=law, width=0.02), r"\pm 0.02"),
        (
            lambda law: WithProjection(law=law, box=GainBox(lower=(-float("inf"),), upper=(1.5,))),
            r"[-\infty, 1.5]",
        ),
        (lambda law: WithLeakage(law=law, leakage=3e-7, centre=(1.0,)), r"3 \cdot 10^{-7}"),
        (lambda law: WithErrorLeakage(law=law, leakage=0.5, centre=(1.0,)), r"|\varepsilon|"),
    ],
)
def test_every_law_has_its_formula(law, names):
    built = law(NormalisedGradientLaw(gain=1.0, alpha=0.25))
    text = "\n".join(law_formulas(built))
    assert names in text
    assert r"\dot{\hat\theta}" in text
    pypandoc.convert_text(text, "latex", format="markdown")


def test_a_law_without_formula_is_refused():
    with pytest.raises(ParameterError, match="no formula"):
        law_formulas(object())


def test_a_place_that_cannot_be_written_is_one_error(tmp_path):
    (tmp_path / "taken.tex").mkdir()
    with pytest.raises(FileError, match="cannot be written"):
        write_formulas(nominal_gain_set(), ROBOT, tmp_path / "taken.tex")
