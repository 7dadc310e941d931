"""Tuned gains: what they are made of, every file format and back, and every way to spoil a file."""

from __future__ import annotations

import hashlib
import json
import tomllib
from dataclasses import replace

import pytest
import scipy.io
import tomli_w
import yaml
from hypothesis import HealthCheck, given, settings
from jsonschema import Draft202012Validator

from mrac_design.controller.adaptation import GradientLaw
from mrac_design.controller.adaptive import build_step
from mrac_design.errors import (
    FileError,
    GainFileError,
    ModelFileError,
    MracDesignError,
    ParameterError,
)
from mrac_design.export import gain_set as gain_set_module
from mrac_design.export.gains import (
    controller_of,
    document_hash,
    document_of,
    gain_set,
    gains_document,
    gains_schema_path,
    read_gains,
    robot_step_of,
    write_gains,
)
from mrac_design.resources import models_directory
from mrac_design.simulation.scenario import load_scenario
from mrac_design.study import VARIANTS, scenario_design, variant_controller
from mrac_design.time_domain import Continuous, Discrete
from tests.export.gain_sets import gain_sets, internal_model_gain_set, nominal_gain_set
from tests.export.scenario_step import scenario_robot_step

SUFFIXES = (".json", ".toml", ".yaml", ".yml", ".mat")


BOTH = {"paper": nominal_gain_set, "internal model": internal_model_gain_set}


def parameters(gains, domain) -> bytes:
    return build_step(controller_of(gains, domain)).parameter_values.tobytes()


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(gains=gain_sets())
def test_every_format_gives_the_same_gains_back(tmp_path_factory, gains):
    folder = tmp_path_factory.getbasetemp()
    for suffix in SUFFIXES:
        path = folder / f"gains{suffix}"
        write_gains(gains, path)
        back = read_gains(path)
        assert back == gains, suffix
        # Equal floats are equal bits but for the sign of zero; the text settles that too.
        assert document_hash(document_of(back)) == document_hash(document_of(gains)), suffix


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(gains=gain_sets())
def test_the_step_read_back_has_the_same_bits(tmp_path_factory, gains):
    path = tmp_path_factory.getbasetemp() / "step.yaml"
    write_gains(gains, path)
    back = read_gains(path)
    for domain in (Continuous(), Discrete(1e-3)):
        assert parameters(back, domain) == parameters(gains, domain)


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.name)
@pytest.mark.parametrize("name", ["nominal", "reality"])  # without and with internal model
def test_gains_are_those_of_the_study(name, variant):
    scenario = load_scenario(name)
    scenario = replace(scenario, adaptation=replace(scenario.adaptation, bias_force=0.7))
    design = scenario_design(scenario)
    gains = gain_set(scenario, design, variant)
    expected = build_step(variant_controller(scenario, design, variant)).parameter_values
    assert parameters(gains, Continuous()) == expected.tobytes()
    assert gains_document(scenario, design, variant) == document_of(gains)


def test_the_whole_robot_step_is_the_scenarios():
    scenario = load_scenario("parameters")  # its robot model is off, and that travels too
    design = scenario_design(scenario)
    ours = robot_step_of(gain_set(scenario, design), scenario.robot, Discrete(1e-3))
    other = scenario_robot_step(scenario, design, VARIANTS[-1], period=1e-3)
    assert ours.parameter_values.tobytes() == other.parameter_values.tobytes()
    assert ours.parameters == other.parameters


def test_gains_refuse_another_robot(tmp_path):
    gains = nominal_gain_set()
    copy = tmp_path / "copy.toml"
    content = (models_directory() / "robots" / "d2m2_set_a.toml").read_text("utf-8")
    copy.write_text(content, "utf-8")
    robot_step_of(gains, str(copy), Discrete(1e-3))
    copy.write_text(content.replace("18.0", "18.1", 1), "utf-8")
    with pytest.raises(ModelFileError, match="not the robot the gains were made for"):
        robot_step_of(gains, str(copy), Discrete(1e-3))


def test_nothing_of_a_controller_gets_lost(monkeypatch):
    """A controller that holds more than the file can is refused, not cut down."""
    kept = gain_set_module.controller_of
    monkeypatch.setattr(
        gain_set_module, "controller_of", lambda *given: replace(kept(*given), prefilter=None)
    )
    scenario = load_scenario("nominal")
    with pytest.raises(ParameterError, match="prefilter"):
        gain_set(scenario, scenario_design(scenario))


@pytest.mark.parametrize("made", BOTH.values(), ids=BOTH)
def test_gains_that_solve_no_design_are_no_gains(made):
    gains = made()
    r1, s0, *rest, last = gains.coefficients
    with pytest.raises(MracDesignError, match="residual"):
        replace(gains, coefficients=(r1, s0 * (1 + 1e-6), *rest, last))
    with pytest.raises(ParameterError, match="t0, t1"):
        replace(gains, coefficients=(r1, s0, *rest, last * (1 + 1e-6)))
    with pytest.raises(ParameterError, match="gains"):
        replace(gains, coefficients=(r1, s0, *rest, float("nan")))
    with pytest.raises(ParameterError, match=f"needs {len(gains.coefficients)} finite"):
        replace(gains, coefficients=gains.coefficients[:-1])


def test_the_schema_is_closed_and_published_documents_fit_it():
    schema = json.loads(gains_schema_path().read_text("utf-8"))
    Draft202012Validator.check_schema(schema)
    for made in BOTH.values():
        Draft202012Validator(schema).validate(document_of(made()))

    def walk(part):
        if isinstance(part, dict):
            if "properties" in part and "required" in part and "if" not in part:
                closed = part.get("additionalProperties") is False or "allOf" in part
                assert closed or "const" in str(part["properties"]), part
            for inner in part.values():
                walk(inner)

    walk(schema)


def test_units_follow_the_powers_of_the_polynomials():
    document = document_of(internal_model_gain_set())
    units = {name: entry["unit"] for name, entry in document["gains"].items()}
    powers = dict(zip("0123", "²³⁴⁵", strict=True))
    assert units == {"r1": "1/s"} | {
        f"{letter}{i}": f"m/(s{power}·N)" for letter in "st" for i, power in powers.items()
    }
    assert {name: entry["unit"] for name, entry in document["scaling"].items()} == units
    assert document["design"]["observer"]["values"] == [1.0, 500.0, 90000.0, 6e6]
    assert len(document["initial_gains"]["values"]) == 9


def test_hash_follows_gains_and_nothing_else_does():
    gains = nominal_gain_set()
    document = document_of(gains)
    other = document_of(replace(gains, scenario="another"))
    assert other["hash"] != document["hash"]
    assert other["design"]["hash"] == document["design"]["hash"]
    moved = document_of(replace(gains, law=GradientLaw(gain=2.0)))
    assert moved["hash"] != document["hash"]


def test_ros_parameters_hold_only_what_ros_allows(tmp_path):
    path = tmp_path / "gains.yaml"
    write_gains(nominal_gain_set(), path)
    content = yaml.safe_load(path.read_text("utf-8"))
    assert list(content) == ["/**"]

    def walk(value):
        if isinstance(value, dict):
            assert all(isinstance(key, str) and "." not in key for key in value)
            for inner in value.values():
                walk(inner)
        elif isinstance(value, list):
            assert {type(entry) for entry in value} == {float}
        else:
            assert type(value) in (float, str)

    walk(content["/**"]["ros__parameters"])


def _write(document, path):
    """A document as it stands, hash and all, without our writers."""
    if path.suffix == ".json":
        path.write_text(json.dumps(document), "utf-8")
    elif path.suffix == ".toml":
        path.write_text(tomli_w.dumps(document), "utf-8")
    elif path.suffix == ".yaml":
        path.write_text(yaml.safe_dump({"/**": {"ros__parameters": document}}), "utf-8")
    else:
        scipy.io.savemat(path, {"mrac_gains": document}, long_field_names=True)
        content = path.read_bytes()[116:]
        text = f"mrac_design gains; SHA-256 of what follows: {hashlib.sha256(content).hexdigest()}"
        path.write_bytes(text.encode().ljust(116) + content)


def _set(*keys, to):
    def spoil(document):
        for key in keys[:-1]:
            document = document[key]
        document[keys[-1]] = to

    return spoil


SPOILED = {
    "unknown key": (_set("gain", to=1.0), "unknown key gain"),
    "unknown key inside": (_set("gains", "r2", to=1.0), "gains: unknown key r2"),
    "former key": (_set("design", "observer_pole", to=1.0), "design: unknown key observer_pole"),
    "missing key": (lambda d: d["design"].pop("damping"), "design: damping missing"),
    "wrong unit": (_set("design", "stiffness", "unit", to="N/mm"), "stiffness.unit: is 'N/mm'"),
    "changed digit": (_set("gains", "s0", "value", to=846.876), "was changed after it was written"),
    "text for number": (_set("gains", "s0", "value", to="846"), "gains.s0.value: is '846'"),
    "old format": (_set("format", to="mrac_design gains 2"), "format: is 'mrac_design gains 2'"),
    "unknown law": (_set("adaptation", "law", to="magic"), "adaptation.law: is 'magic'"),
    "wrong hash": (_set("hash", to="0" * 64), "hash: the content was changed"),
    "short hash": (_set("robot", "sha256", to="abc"), "robot.sha256"),
}  # fmt: skip


@pytest.mark.parametrize("suffix", [".json", ".toml", ".yaml", ".mat"])
@pytest.mark.parametrize("case", SPOILED)
def test_a_spoiled_file_is_one_clear_error(tmp_path, suffix, case):
    spoil, names = SPOILED[case]
    document = json.loads(json.dumps(document_of(nominal_gain_set())))
    path = tmp_path / f"mine{suffix}"
    _write(document, path)
    assert read_gains(path) == nominal_gain_set()
    spoil(document)
    _write(document, path)
    with pytest.raises(GainFileError) as caught:
        read_gains(path)
    text = str(caught.value)
    assert names in text
    assert str(path) in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("keys", "value", "names"),
    [
        (("bias_force", "value"), -1.0, "bias force"),
        (("adaptation", "normalisation", "value"), 0.0, "alpha"),
        (("gains", "s0", "value"), 846.0, "residual"),
        (("initial_gains", "values"), [1.0, 2.0], "initial_gains.values"),
        (("initial_gains", "values"), [1.0] * 7, "initial gains"),
        (("gains", "s2"), {"value": 1.0, "unit": "m/(s⁴·N)"}, "must be r1, s0, s1, t0, t1"),
        (("gains", "s2"), {"value": 1.0, "unit": "m/(s³·N)"}, "gains.s2.unit"),
        (("design", "observer", "values"), [1.0, 20.0, 100.0], "must be of degree 1"),
        (("design", "observer", "values"), [1.0, -500.0], "left of 0"),
        (("design", "observer", "unit"), "rad/s", "observer.unit"),
        (("design", "internal_model", "values"), [], "internal_model.values"),
        (("scaling", "s0", "value"), 1.0, "do not belong"),
        (("design", "hash"), "0" * 64, "do not belong"),
        (("design", "bandwidth", "value"), -1.0, "bandwidth"),
    ],
)
def test_a_new_hash_does_not_make_bad_gains_good(tmp_path, keys, value, names):
    document = json.loads(json.dumps(document_of(nominal_gain_set())))
    _set(*keys, to=value)(document)
    document["hash"] = document_hash(document)
    path = tmp_path / "gains.json"
    _write(document, path)
    with pytest.raises(GainFileError, match=names):
        read_gains(path)


@pytest.mark.parametrize(
    ("name", "content", "names"),
    [
        ("a.json", b"{", "not valid JSON"),
        ("a.json", b"[]", "holds no table"),
        ("a.json", b"\xff\xfe", "UTF-8"),
        ("a.json", b'{"format": "a", "format": "b"}', 'the key "format" twice'),
        ("a.json", b'{"format": NaN}', "finite number"),
        ("a.toml", b"a = ", "not valid TOML"),
        ("a.toml", b"a = inf", "finite number"),
        ("a.yaml", b"a: [", "not valid YAML"),
        ("a.yaml", b"a: 1\na: 2", 'the key "a" twice'),
        ("a.yaml", b"node: {parameters: {}}", "ros__parameters"),
        ("a.yaml", b"", "ros__parameters"),
        ("a.mat", b"not a MATLAB file at all", "not a MATLAB file as"),
        ("a.mat", b"", "not a MATLAB file as"),
    ],
)
def test_a_file_of_no_format_is_one_clear_error(tmp_path, name, content, names):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(GainFileError, match=names) as caught:
        read_gains(path)
    assert "\n" not in str(caught.value)


def test_a_damaged_matlab_file_is_one_clear_error(tmp_path):
    path = tmp_path / "gains.mat"
    write_gains(nominal_gain_set(), path)
    content = bytearray(path.read_bytes())
    # Every 37th byte: header, sizes, names and numbers all get their share.
    for place in range(0, len(content), 37):
        spoiled = bytearray(content)
        spoiled[place] ^= 4
        path.write_bytes(spoiled)
        with pytest.raises(GainFileError, match="not a MATLAB file as"):
            read_gains(path)


def test_files_that_are_not_there_or_cannot_be_written(tmp_path):
    with pytest.raises(GainFileError, match="cannot be read"):
        read_gains(tmp_path / "nowhere.json")
    with pytest.raises(ParameterError, match=r"must end in \.json"):
        write_gains(nominal_gain_set(), tmp_path / "gains.xml")
    folder = tmp_path / "taken.json"
    folder.mkdir()
    with pytest.raises(FileError, match="cannot be written"):
        write_gains(nominal_gain_set(), folder)
    assert [path.name for path in tmp_path.iterdir()] == ["taken.json"]


def test_toml_is_toml(tmp_path):
    path = tmp_path / "gains.toml"
    write_gains(nominal_gain_set(), path)
    assert tomllib.loads(path.read_text("utf-8"))["gains"]["r1"] == {"value": 1450.0, "unit": "1/s"}
