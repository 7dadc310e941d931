"""The texts that fill the templates of a C package."""

from __future__ import annotations

import hashlib
import json
import textwrap
from collections.abc import Mapping, Sequence
from importlib.metadata import version

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.controller.robot_step import RobotStep
from mrac_design.export.c_counts import StepCosts
from mrac_design.export.c_expressions import DOUBLE, RealType, c_statements
from mrac_design.export.c_selftest import SelfTest
from mrac_design.layout import Layout

_MEANINGS: Mapping[str, str] = {
    "inertia": "the controller's model: masses, first moments, inertias, drives",
    "torque_scale": "factor on each joint's row of the model",
    "velocity_gain": "K2, 1/s",
    "tool_axis_gains": "PD of the tool axis, 1/s^2 and 1/s",
    "tool_axis_target": "components of the tool axis that are held",
    "effort_limit": "N m or N",
    "bandwidth": "omega of the reference model, rad/s",
    "b0": "contact stiffness of the design, N/m",
    "observer": "Ao after its leading 1, i-th in 1/s^i",
    "model_polynomial": "Am after its leading 1, 1/s and 1/s^2",
    "internal_model": "D of R = (p + r1) D, leading 1 first; i-th after it in 1/s^i",
    "adapted_pole": "c of the adapted r1' = r1 - c, 1/s",
    "known": "(p + c) D - Ao, highest power first",
    "scaling": "gains in SI units per scaled gain",
    "filter_A": "regressor filter over one period, by rows",
    "filter_B": "its input",
    "model_A": "reference model over one period, by rows",
    "model_B": "its input",
    "feedforward": "weights of the reference's derivatives, s and s^2",
    "initial_gains": "scaled gains after init and reset",
    "prefilter_A": "pre-filter over one period, by rows",
    "prefilter_B": "its input",
    "prefilter_bandwidth": "rad/s",
    "prefilter_damping": "damping ratio",
    "adaptation_gain": "scaled adaptation gains; 0 freezes",
    "normalisation": "alpha of the normalised law, N^2",
    "filtered_command": "applied command through 1/Ao, powers of p down to 0, then 1/(Ao Am)",
    "filtered_force": "force, the same",
    "filtered_reference": "u_c, the same",
    "gains": "scaled gains r1', s0, s1, ..., t0, t1, ..., bias",
    "model": "reference model: rate N/s, output N",
    "prefilter": "pre-filter: rate N/s, output N",
    "command": "computed by the axis controllers, m/s^2",
    "applied_command": "what the limited torques carry out, m/s^2",
    "desired_force": "pre-filtered reference, N",
    "model_force": "output of the reference model, N",
    "augmented_error": "N",
    "adapted_gains": "scaled, axis by axis",
}
"""What a block is, for the comments of the header; a block that is not here goes without."""


def parameters_hash(step: RobotStep) -> str:
    """SHA-256 of the parameters' names and values and the period, in canonical JSON."""
    content = {
        "period": step.time_domain.period,
        "parameters": dict(
            zip(step.parameters.entry_names, step.parameter_values.tolist(), strict=True)
        ),
    }
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def package_texts(
    step: RobotStep,
    number: RealType,
    *,
    test: SelfTest,
    tolerance: float,
    gains_hash: str,
    title: str,
) -> dict[str, str]:
    """A text for every field of the C templates, by the field's name."""
    return {
        **_identity(step, number, gains_hash, title),
        **_declarations(step),
        **_code(step, number),
        **_vectors(step, test, number, tolerance),
    }


def cost_texts(step: RobotStep, number: RealType, costs: StepCosts) -> dict[str, str]:
    """What the README says about the cost of a step, by the field's name."""
    size = number.dtype.itemsize
    rows = [
        ("state", f"{step.state.size * size} bytes ({step.state.size} numbers)"),
        ("parameters", f"{step.parameters.size * size} bytes ({step.parameters.size} numbers)"),
        ("operations of the expression graph", str(costs.operations)),
    ]
    if costs.stack_bytes is not None:
        rows.append(("stack of `mrac_step`", f"{costs.stack_bytes} bytes"))
    if costs.instructions is None:
        counting = (
            "The number of operations is counted on the expression graph; instructions were not "
            f"measured: {costs.tools}."
        )
    else:
        rows.append(("instructions of `mrac_step`", f"{costs.instructions:.0f}"))
        counting = (
            "Instructions were counted and the stack was taken on the machine that exported the "
            f"package ({costs.tools}), on average over the self-test. The code is a straight line: "
            "only the selects of limits and projections could become branches."
        )
    return {
        "costs": "\n".join(f"| {name} | {value} |" for name, value in rows),
        "counting": textwrap.fill(counting, 100),
    }


def _identity(step: RobotStep, number: RealType, gains_hash: str, title: str) -> dict[str, str]:
    robot, period = step.robot, step.time_domain.period
    provenance = " ".join(robot.provenance.split()).replace("*/", "* /")
    return {
        "title": title.replace("*/", "* /"),
        "robot": robot.name,
        "axes": ", ".join(robot.force_axes),
        "provenance": "\n".join(
            textwrap.wrap(provenance, 92, initial_indent=" * ", subsequent_indent=" * ")
        ),
        "provenance_text": textwrap.fill(provenance, 100),
        "version": version("mrac-design"),
        "gains_hash": gains_hash,
        "parameters_hash": parameters_hash(step),
        "period": f"{period:g}",
        "period_literal": number.literal(period),
        "real": number.name,
        "joints": str(robot.joint_count),
        "axis_count": str(len(robot.force_axes)),
    }


def _declarations(step: RobotStep) -> dict[str, str]:
    axes = step.robot.force_axes
    return {
        "parameter_members": _members(step.parameters, axes),
        "state_members": _members(step.state, axes),
        "signal_members": _members(step.signals, axes),
    }


def _members(layout: Layout, axes: Sequence[str]) -> str:
    lines = []
    for name, length in layout.blocks:
        if length == 0:  # ISO C knows no array of length zero
            continue
        declaration = f"    mrac_real {name}{'' if length == 1 else f'[{length}]'};"
        meaning = _MEANINGS.get(_without_axis(name, axes))
        lines.append(declaration if meaning is None else f"{declaration} /* {meaning} */")
    return "\n".join(lines)


def _without_axis(name: str, axes: Sequence[str]) -> str:
    prefix, _, rest = name.partition("_")
    return rest if prefix in axes else name


def _code(step: RobotStep, number: RealType) -> dict[str, str]:
    n, k = step.robot.joint_count, len(step.robot.force_axes)
    state = _lvalues("state->", step.state)
    parameters = _lvalues("parameters->", step.parameters)
    inputs = [
        [f"inputs->{name}[{i}]" for i in range(size)]
        for name, size in (("q", n), ("qd", n), ("force", k), ("reference", k))
    ]
    torque = [f"outputs->torque[{i}]" for i in range(n)]
    stepped = c_statements(
        step.step,
        inputs=[state, *inputs, parameters],
        outputs=[state, torque, _lvalues("outputs->", step.signals)],
        real="mrac_real",
        number=number,
    )
    reset = c_statements(
        step.equilibrium,
        inputs=[[f"force[{i}]" for i in range(k)], parameters],
        outputs=[state],
        real="mrac_real",
        number=number,
    )
    zero = number.literal(0.0)
    return {
        "step_statements": _indented(stepped),
        "reset_statements": _indented(reset),
        "parameter_values": _initialisers(step.parameters, step.parameter_values, number),
        "zero": zero,
        "finite_test": "\n           & ".join(f"({t} - {t} == {zero})" for t in torque),
    }


def _lvalues(owner: str, layout: Layout) -> list[str]:
    return [f"{owner}{name}" for name in layout.entry_names]


def _indented(statements: Sequence[str]) -> str:
    return "\n".join(f"    {statement}" for statement in statements)


def _initialisers(layout: Layout, values: FloatArray, number: RealType) -> str:
    lines = []
    for name, part in layout.split(np.asarray(values)).items():
        if part.size == 0:
            continue
        text = _list(part, number)
        lines.append(f"    .{name} = {text if part.size == 1 else f'{{{text}}}'},")
    return "\n".join(lines)


def _list(values: FloatArray, number: RealType) -> str:
    return ", ".join(number.literal(float(value)) for value in values)


def _vectors(step: RobotStep, test: SelfTest, number: RealType, tolerance: float) -> dict[str, str]:
    # Expectations stay in double whatever the controller computes in.
    accepted = "Every bit has to agree here."
    if tolerance > 0.0:
        accepted = (
            f"Here torques may differ by {tolerance:.2g} of their limits and states by "
            f"{tolerance:.2g} of 1 + |x|: four times what these operations give in {number.name}."
        )
    return {
        "steps": str(len(test.inputs)),
        "states": str(step.state.size),
        "tolerance": DOUBLE.literal(tolerance),
        "tolerance_text": textwrap.fill(accepted, 100),
        "tolerance_comment": textwrap.fill(
            accepted, 98, initial_indent=" * ", subsequent_indent=" * "
        ),
        "resting_force": _list(test.resting_force, number),
        "inputs": "\n".join(f"    {{{_list(row, number)}}}," for row in test.inputs),
        "torque": "\n".join(f"    {{{_list(row, DOUBLE)}}}," for row in test.torque),
        "final_state": "\n".join(f"    {DOUBLE.literal(float(x))}," for x in test.final_state),
        "final_state_list": "\n".join(
            f"            {lvalue}," for lvalue in _lvalues("state.", step.state)
        ),
    }
