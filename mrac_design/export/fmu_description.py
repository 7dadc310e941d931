"""The model description of a controller's FMU: every variable with name, unit and role."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from xml.etree import ElementTree

from mrac_design.controller.robot_step import RobotStep
from mrac_design.robot import JointType, parameter_names

MODEL_IDENTIFIER = "mrac_controller"
"""Name of the FMU's binary."""

_BASE_UNITS: Mapping[str, Mapping[str, int]] = {
    "1/s": {"s": -1},
    "1/s2": {"s": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N/m": {"kg": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "N2": {"kg": 2, "m": 2, "s": -4},
    "kg": {"kg": 1},
    "kg.m": {"kg": 1, "m": 1},
    "kg.m2": {"kg": 1, "m": 2},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
}
"""Every unit used, in powers of SI base units."""

_BLOCK_UNITS: Mapping[str, str] = {
    "velocity_gain": "1/s",
    "bandwidth": "rad/s",
    "adapted_pole": "1/s",
    "b0": "N/m",
    "prefilter_bandwidth": "rad/s",
    "normalisation": "N2",
    "dead_zone": "N",
    "command": "m/s2",
    "applied_command": "m/s2",
    "desired_force": "N",
    "model_force": "N",
    "augmented_error": "N",
}
"""Units of whole blocks; blocks not named here mix units or have none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuVariable:
    """One scalar variable; its place in the list is its value reference."""

    name: str
    """Name, as in the step's layouts."""
    causality: str
    """"input", "output", "local" or "parameter"."""
    variability: str
    """"continuous", "discrete" or "tunable"."""
    unit: str | None
    """Unit, None for a pure or mixed number."""
    start: float | None
    """Start value; None where it is calculated."""
    description: str
    """What it is; may be empty."""


def fmu_variables(step: RobotStep) -> tuple[FmuVariable, ...]:
    """Inputs (q, qd, force, reference), torques, signals, parameters, in this order."""
    return (*_inputs(step), *_torques(step), *_signals(step), *_parameters(step))


def model_description(
    step: RobotStep,
    variables: tuple[FmuVariable, ...],
    *,
    guid: str,
    title: str,
    description: str,
    version: str,
    source: str,
) -> str:
    """modelDescription.xml of FMI 2.0 for co-simulation; `source` is the file in sources/."""
    root = ElementTree.Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=title,
        guid=guid,
        description=description,
        version=version,
        generationTool=f"mrac_design {version}",
        variableNamingConvention="structured",
    )
    _add_co_simulation(root, source)
    _add_units(root, variables)
    categories = ElementTree.SubElement(root, "LogCategories")
    ElementTree.SubElement(categories, "Category", name="logStatusError")
    period = repr(step.time_domain.period)
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stepSize=period)
    listed = ElementTree.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        _add_variable(listed, reference, variable)
    structure = ElementTree.SubElement(root, "ModelStructure")
    outputs = [i for i, variable in enumerate(variables, 1) if variable.causality == "output"]
    for kind in ("Outputs", "InitialUnknowns"):
        unknowns = ElementTree.SubElement(structure, kind)
        for index in outputs:
            ElementTree.SubElement(unknowns, "Unknown", index=str(index))
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'


def _add_co_simulation(root: ElementTree.Element, source: str) -> None:
    slave = ElementTree.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=MODEL_IDENTIFIER,
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    files = ElementTree.SubElement(slave, "SourceFiles")
    ElementTree.SubElement(files, "File", name=source)


def _add_units(root: ElementTree.Element, variables: tuple[FmuVariable, ...]) -> None:
    units = ElementTree.SubElement(root, "UnitDefinitions")
    for name in sorted({variable.unit for variable in variables if variable.unit}):
        unit = ElementTree.SubElement(units, "Unit", name=name)
        powers = {base: str(power) for base, power in _BASE_UNITS[name].items()}
        ElementTree.SubElement(unit, "BaseUnit", powers)


def _add_variable(parent: ElementTree.Element, reference: int, variable: FmuVariable) -> None:
    attributes = {
        "name": variable.name,
        "valueReference": str(reference),
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.description:
        attributes["description"] = variable.description
    scalar = ElementTree.SubElement(parent, "ScalarVariable", attributes)
    real = {} if variable.unit is None else {"unit": variable.unit}
    if variable.start is not None:
        real["start"] = repr(float(variable.start))
    ElementTree.SubElement(scalar, "Real", real)


def _inputs(step: RobotStep) -> Iterator[FmuVariable]:
    def measured(name: str, unit: str, start: float, description: str) -> FmuVariable:
        return FmuVariable(
            name=name, causality="input", variability="continuous", unit=unit, start=start,
            description=description,
        )  # fmt: skip

    joints = step.robot.joints
    units = ["m" if joint.type is JointType.PRISMATIC else "rad" for joint in joints]
    for i, (joint, unit) in enumerate(zip(joints, units, strict=True)):
        yield measured(f"q[{i}]", unit, joint.home, f"measured position, {joint.name}")
    for i, (joint, unit) in enumerate(zip(joints, units, strict=True)):
        yield measured(f"qd[{i}]", f"{unit}/s", 0.0, f"measured velocity, {joint.name}")
    for i, axis in enumerate(step.robot.force_axes):
        yield measured(f"force[{i}]", "N", 0.0, f"measured contact force, {axis}")
    for i, axis in enumerate(step.robot.force_axes):
        yield measured(
            f"reference[{i}]", "N", 0.0, f"force reference before the pre-filter, {axis}"
        )


def _torques(step: RobotStep) -> Iterator[FmuVariable]:
    for i, joint in enumerate(step.robot.joints):
        yield FmuVariable(
            name=f"torque[{i}]",
            causality="output",
            variability="discrete",
            unit="N" if joint.type is JointType.PRISMATIC else "N.m",
            start=None,
            description=f"joint effort within its limit, {joint.name}",
        )


def _signals(step: RobotStep) -> Iterator[FmuVariable]:
    axes = step.robot.force_axes
    for block, length in step.signals.blocks:
        # Each axis contributes an equal share of a block, in the order of the axes.
        share = max(length // len(axes), 1)
        for i in range(length):
            yield FmuVariable(
                name=block if length == 1 else f"{block}[{i}]",
                causality="local",
                variability="discrete",
                unit=_BLOCK_UNITS.get(block),
                start=None,
                description=f"{block.replace('_', ' ')}, {axes[i // share]}",
            )


def _parameters(step: RobotStep) -> Iterator[FmuVariable]:
    axes, joints = step.robot.force_axes, step.robot.joints
    inertial = parameter_names(step.robot)
    values = iter(step.parameter_values.tolist())
    for block, length in step.parameters.blocks:
        prefix, _, rest = block.partition("_")
        for i in range(length):
            unit, description = _BLOCK_UNITS.get(rest if prefix in axes else block), ""
            if block == "inertia":
                unit, description = _inertial_unit(step, inertial[i]), inertial[i]
            elif block == "effort_limit":
                prismatic = joints[i].type is JointType.PRISMATIC
                unit, description = "N" if prismatic else "N.m", joints[i].name
            yield FmuVariable(
                name=block if length == 1 else f"{block}[{i}]",
                causality="parameter",
                variability="tunable",
                unit=unit,
                start=next(values),
                description=description,
            )


def _inertial_unit(step: RobotStep, name: str) -> str:
    """Unit of an inertial parameter: m1, mx1, Ixx1, or Ia1 of a drive."""
    letters = name.rstrip("0123456789")
    number = int(name[len(letters) :])
    if letters == "Ia" and step.robot.joints[number - 1].type is JointType.PRISMATIC:
        return "kg"
    if letters == "m":
        return "kg"
    return "kg.m" if letters.startswith("m") else "kg.m2"
