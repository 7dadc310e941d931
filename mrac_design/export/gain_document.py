"""Gains as plain data with units and hashes, and the strict way back.

The structure is laid down in `gains.schema.json`, published beside this module. The data hold
texts, numbers, lists of numbers and tables of these only, so every format can carry them.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from mrac_design.controller.linearisation import RobotModelError
from mrac_design.controller.reference import DirectReference, ModelInverse
from mrac_design.design import ReferenceModel, RSTDesign, RSTSpecification
from mrac_design.errors import GainFileError, MracDesignError, ParameterError
from mrac_design.export.gain_laws import law_document, law_of, quantities, quantity
from mrac_design.export.gain_set import GainSet, RobotFingerprint
from mrac_design.plant import ForcePlant

FORMAT = "mrac_design gains 3"
"""First entry of every document; the number changes when the structure does."""

_POLYNOMIAL_UNIT = "1/s^i"
"""Unit of the coefficients of a monic polynomial in p, i counted from 0."""

_FEEDFORWARDS: Mapping[str, DirectReference | ModelInverse] = {
    "direct": DirectReference(),
    "model_inverse": ModelInverse(),
}


def gains_schema_path() -> Path:
    """The published JSON schema of a gains document."""
    return Path(__file__).with_name("gains.schema.json")


def document_of(gains: GainSet) -> dict[str, Any]:
    """Gains as plain data.

    `gains` holds r1 itself (the adapted one is r1 − c); `scaling` is D of θ = D θ̂; `design.hash`
    is the SHA-256 of design and gains, `hash` that of everything else in canonical JSON.
    """
    specification = gains.specification
    model, plant = specification.reference_model, specification.plant
    design = {
        "stiffness": quantity(plant.stiffness, "N/m"),
        "velocity_gain": quantity(plant.velocity_gain, "1/s"),
        "bandwidth": quantity(model.bandwidth, "rad/s"),
        "damping": quantity(model.damping, "1"),
        "observer": quantities(specification.observer, _POLYNOMIAL_UNIT),
        "internal_model": quantities(specification.internal_model, _POLYNOMIAL_UNIT),
    }
    coefficients = _named(gains.design, gains.coefficients)
    content = {
        "format": FORMAT,
        "mrac_design": gains.package_version,
        "scenario": gains.scenario,
        "robot": {"file": gains.robot.file, "sha256": gains.robot.sha256},
        "design": {**design, "hash": document_hash({**design, "gains": coefficients})},
        "gains": coefficients,
        "scaling": _named(gains.design, gains.design.scaling.tolist()),
        "initial_gains": quantities(gains.initial_gains, "1"),
        "prefilter": _prefilter_document(gains.prefilter),
        "feedforward": "direct" if gains.feedforward == DirectReference() else "model_inverse",
        "adaptation": law_document(gains.law),
        "bias_force": quantity(gains.bias_force, "N"),
        "linearisation": {
            "tool_axis_bandwidth": quantity(gains.tool_axis_bandwidth, "rad/s"),
            "body_scale": quantity(gains.robot_model.body_scale, "1"),
            "first_joint_scale": quantity(gains.robot_model.first_joint_scale, "1"),
        },
    }
    return {**content, "hash": document_hash(content)}


def document_hash(document: Mapping[str, Any]) -> str:
    """SHA-256 of the document without its `hash`, in canonical JSON."""
    content = {key: value for key, value in document.items() if key != "hash"}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def gains_of(document: Mapping[str, Any], path: Path) -> GainSet:
    """The gains a document holds; `path` is named in errors.

    Raises GainFileError for an unknown or missing key, a wrong unit, a value of the wrong kind,
    numbers that were changed since the document was written, or gains that are none.
    """
    plain = _plain(document, path, "")
    _check_structure(plain, path)
    if plain["hash"] != document_hash(plain):
        raise GainFileError(
            path,
            "hash",
            "the content was changed after it was written (its SHA-256 is "
            f"{document_hash(plain)[:12]}…, not {plain['hash'][:12]}…); export the gains again",
        )
    try:
        gains = _build(plain)
    except MracDesignError as problem:
        raise GainFileError(path, "", str(problem)) from problem
    if document_of(gains) != plain:
        raise GainFileError(
            path, "", "scaling and design.hash do not belong to the rest; export the gains again"
        )
    return gains


def _build(document: Mapping[str, Any]) -> GainSet:
    design, linearisation = document["design"], document["linearisation"]
    prefilter = document["prefilter"]
    specification = RSTSpecification(
        plant=ForcePlant(
            stiffness=design["stiffness"]["value"],
            velocity_gain=design["velocity_gain"]["value"],
        ),
        reference_model=_second_order(design),
        observer=tuple(design["observer"]["values"]),
        internal_model=tuple(design["internal_model"]["values"]),
    )
    return GainSet(
        scenario=document["scenario"],
        package_version=document["mrac_design"],
        robot=RobotFingerprint(**document["robot"]),
        specification=specification,
        coefficients=_coefficients(document["gains"], specification),
        initial_gains=tuple(document["initial_gains"]["values"]),
        prefilter=None if prefilter["kind"] == "none" else _second_order(prefilter),
        feedforward=_FEEDFORWARDS[document["feedforward"]],
        law=law_of(document["adaptation"]),
        bias_force=document["bias_force"]["value"],
        tool_axis_bandwidth=linearisation["tool_axis_bandwidth"]["value"],
        robot_model=RobotModelError(
            body_scale=linearisation["body_scale"]["value"],
            first_joint_scale=linearisation["first_joint_scale"]["value"],
        ),
    )


def _named(design: RSTDesign, values: Sequence[float]) -> dict[str, Any]:
    return {
        name: quantity(value, unit)
        for (name, _, unit), value in zip(design.coefficients, values, strict=True)
    }


def _coefficients(
    document: Mapping[str, Any], specification: RSTSpecification
) -> tuple[float, ...]:
    names = ("r1", *specification.gain_names[1:])
    if set(names) != set(document):
        raise ParameterError(
            "gains", ", ".join(document), f"must be {', '.join(names)} with this observer"
        )
    return tuple(document[name]["value"] for name in names)


def _prefilter_document(prefilter: ReferenceModel | None) -> dict[str, Any]:
    if prefilter is None:
        return {"kind": "none"}
    return {
        "kind": "second_order",
        "bandwidth": quantity(prefilter.bandwidth, "rad/s"),
        "damping": quantity(prefilter.damping, "1"),
    }


def _second_order(document: Mapping[str, Any]) -> ReferenceModel:
    return ReferenceModel(
        bandwidth=document["bandwidth"]["value"], damping=document["damping"]["value"]
    )


def _plain(value: Any, path: Path, place: str) -> Any:
    """The same data with every number a finite float, or an error naming the place."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v, path, f"{place}.{k}".strip(".")) for k, v in value.items()}
    if isinstance(value, list):
        return [_plain(entry, path, f"{place}[{i}]") for i, entry in enumerate(value, 1)]
    if isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if math.isfinite(number):
            return number
        raise GainFileError(path, place, f"is {value}, needs a finite number")
    return value


@cache
def _validator() -> Any:
    from jsonschema import Draft202012Validator

    return Draft202012Validator(json.loads(gains_schema_path().read_text(encoding="utf-8")))


def _check_structure(document: dict[str, Any], path: Path) -> None:
    found = document.get("format")
    if found != FORMAT:
        raise GainFileError(path, "format", f'is {found!r}, only "{FORMAT}" is read; export again')
    errors = sorted(
        _validator().iter_errors(document), key=lambda error: [str(part) for part in error.path]
    )
    if errors:
        error = errors[0]
        place = ".".join(str(part) for part in error.path)
        raise GainFileError(path, place, _problem(error))


def _problem(error: Any) -> str:
    """What a schema error means to the person who edited the file."""
    value, rule = error.instance, error.validator_value
    if error.validator == "required":
        missing = [key for key in rule if key not in value]
        return f"{', '.join(missing)} missing; no key has a default"
    if error.validator == "additionalProperties":
        unknown = sorted(set(value) - set(error.schema["properties"]))
        return f"unknown key {', '.join(unknown)}"
    if error.validator == "const":
        return f'is {value!r}, only "{rule}" is read'
    if error.validator == "enum":
        return f"is {value!r}, must be {' or '.join(map(repr, rule))}"
    if error.validator == "type":
        return f"is {value!r}, needs a value of the kind {rule}"
    return str(error.message)
