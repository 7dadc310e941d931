"""The checker accepts what is proved and names the line of whatever was altered."""

from __future__ import annotations

import hashlib
import json
import random
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest
from flint import fmpq

from mrac_design.errors import CertificateError
from mrac_design.stability.certificate_file import (
    certificate_document,
    certificate_schema,
    gains_hash,
    write_certificate,
)
from mrac_design.stability.certification import certify
from mrac_design.stability.parameter_box import relative_box
from mrac_design.stability.sampled_loop import sampling
from mrac_design.time_domain import Continuous
from mrac_design.verify import verify_certificate
from tests.stability.internal_models import HEART_BAND, INTEGRATOR
from tests.stability.test_certificate import rst_loop

CASES = {
    "continuous": (rst_loop(500, 50), "0.3", Continuous()),
    "sampled": (rst_loop(200, 50), "0.15", sampling("1/1000", 1)),
    "no velocity loop": (rst_loop(200, 0), "0.1", sampling("1/1000", 0)),
    "integrator": (INTEGRATOR.loop, ("0.02", "0", "0", "0.02"), sampling("1/1000", 1)),
    "heart band": (HEART_BAND.loop, ("0.02", "0", "0", "0.02", "0"), sampling("1/1000", 1)),
}


@pytest.fixture(scope="module", params=CASES)
def path(request, tmp_path_factory) -> Path:
    loop, box, timing = CASES[request.param]
    target = tmp_path_factory.mktemp("certificate") / "certificate.json"
    write_certificate(certify(loop, relative_box(loop, box, (800, 1000)), timing), target)
    return target


def leaves(node, trail=()):
    """(keys, value) of every text in a JSON document."""
    if isinstance(node, dict):
        for key, inner in node.items():
            yield from leaves(inner, (*trail, key))
    elif isinstance(node, list):
        for key, inner in enumerate(node):
            yield from leaves(inner, (*trail, key))
    else:
        yield trail, node


def replaced(document, trail, value):
    copy = json.loads(json.dumps(document))
    node = copy
    for key in trail[:-1]:
        node = node[key]
    node[trail[-1]] = value
    return copy


def resealed(document):
    """What a forger would do: new digests for every value, and a new hash of the gains."""
    document = json.loads(json.dumps(document))
    loop = {k: v if isinstance(v, str) else " ".join(v) for k, v in document["loop"].items()}
    lines = "".join(f"{k}={v}\n" for k, v in sorted(loop.items()))
    document["gains_hash"] = hashlib.sha256(lines.encode()).hexdigest()
    document.pop("seal")
    pointers = {"".join(f"/{key}" for key in trail): value for trail, value in leaves(document)}
    document["seal"] = {
        p: hashlib.sha256(f"{p}\n{v}".encode()).hexdigest()[:16] for p, v in pointers.items()
    }
    return document


def checked(document, path: Path):
    target = path.with_name("altered.json")
    target.write_text(json.dumps(document, indent=1), encoding="utf-8")
    return verify_certificate(target), target.read_text().splitlines()


def test_a_proved_certificate_is_accepted(path) -> None:
    report = verify_certificate(path)
    assert report.accepted, report.findings
    assert len(report.statements) == len(json.loads(path.read_text())["claims"])


def test_the_document_follows_its_schema(path) -> None:
    jsonschema.Draft202012Validator.check_schema(certificate_schema())
    jsonschema.validate(json.loads(path.read_text()), certificate_schema())


def test_any_single_altered_number_is_named_by_its_line(path) -> None:
    document = json.loads(path.read_text())
    generator = random.Random(1)
    trails = [(t, v) for t, v in leaves(document) if any(c.isdigit() for c in v)]
    for trail, value in trails:
        digits = [k for k, c in enumerate(value) if c.isdigit()]
        spot = generator.choice(digits)
        new = str((int(value[spot]) + generator.randint(1, 9)) % 10)
        altered = value[:spot] + new + value[spot + 1 :]
        report, lines = checked(replaced(document, trail, altered), path)
        assert not report.accepted, trail
        named = {finding.line for finding in report.findings}
        own = {k for k, line in enumerate(lines, start=1) if f'"{altered}"' in line}
        if trail[0] == "seal":
            pointer = trail[1]
            assert pointer in {finding.pointer for finding in report.findings}
        else:
            assert named & own, (trail, report.findings)


@pytest.mark.parametrize("kind", ["P", "gain", "rate"])
def test_a_forged_seal_does_not_save_a_false_claim(path, kind) -> None:
    document = json.loads(path.read_text())
    for index, claim in enumerate(document["claims"]):
        if kind not in claim:
            continue
        trail = ("claims", index, kind)
        if kind == "P":
            trail, value = (*trail, 1, 1), "-1"
        else:
            old = fmpq(*(int(part) for part in (claim[kind] + "/1").split("/")[:2]))
            value = str(old * 50 if kind == "rate" else old / 5)
        report, _ = checked(resealed(replaced(document, trail, value)), path)
        assert not report.accepted
        assert any(f.pointer.startswith(f"/claims/{index}") for f in report.findings)


def test_a_forged_box_or_plant_is_refused(path) -> None:
    document = json.loads(path.read_text())
    forgeries = [
        (("box", "stiffness_ratio", 1), "9"),
        (("box", "upper", 2), "40"),
        (("loop", "gains", 2), "1"),
        (("loop", "gain_scale", 1), "1"),
        (("loop", "observer", 0), "2"),
        (("format",), "another format"),
    ]
    if document["timing"]["kind"] == "sampled":
        forgeries += [
            (("timing", "period"), "1/50"),
            (("timing", "observer_transition", 0, 0), "1"),
            (("timing", "observer_input", 0), "1/500"),
            (("timing", "energy_input", 1, 1), "1/1000000"),
        ]
    for trail, value in forgeries:
        report, _ = checked(resealed(replaced(document, trail, value)), path)
        assert not report.accepted, trail


def test_a_box_without_the_nominal_gains_is_refused(path) -> None:
    document = json.loads(path.read_text())
    upper = document["box"]["upper"][0]
    report, _ = checked(resealed(replaced(document, ("box", "lower", 0), upper)), path)
    assert [f.problem for f in report.findings] == ["the nominal gain is outside the box"]


def test_an_older_format_is_refused_in_a_sentence(path) -> None:
    document = json.loads(path.read_text())
    older = document["format"].replace("2", "1")
    report, _ = checked(resealed(replaced(document, ("format",), older)), path)
    assert [f.pointer for f in report.findings] == ["/format"]
    assert "make the certificate again" in report.findings[0].problem


def test_missing_and_malformed_parts_are_findings(path) -> None:
    document = json.loads(path.read_text())
    for key in ("loop", "box", "timing", "claims", "seal", "gains_hash"):
        copy = {k: v for k, v in document.items() if k != key}
        assert not checked(copy, path)[0].accepted
    assert not checked(resealed(replaced(document, ("box", "lower", 0), "0.5x")), path)[0].accepted
    endless = resealed(replaced(document, ("box", "lower", 0), "9" * 5000))
    assert not checked(endless, path)[0].accepted
    broken = path.with_name("broken.json")
    broken.write_text('{"format": ')
    assert "not a JSON" in verify_certificate(broken).findings[0].problem
    twice = path.with_name("twice.json")
    twice.write_text(path.read_text().replace('"box": {', '"gains_hash": "0",\n "box": {', 1))
    assert not verify_certificate(twice).accepted


def test_a_weaker_true_claim_is_accepted(path) -> None:
    """A larger gain is still true, so an honest author may state it."""
    document = json.loads(path.read_text())
    report, _ = checked(resealed(replaced(document, ("claims", 1, "gain"), "1000000")), path)
    assert report.accepted


def test_the_command_runs_with_python_flint_alone(path) -> None:
    blocked = [
        "numpy",
        "scipy",
        "casadi",
        "control",
        "cvxpy",
        "clarabel",
        "matplotlib",
        "jsonschema",
        "typer",
    ]
    code = (
        "import sys, runpy\n"
        f"sys.modules.update(dict.fromkeys({blocked!r}))\n"
        f"sys.argv = ['verify', {str(path)!r}]\n"
        "runpy.run_module('mrac_design.verify', run_name='__main__')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("accepted\n")


def test_the_command_names_file_and_line(path) -> None:
    document = json.loads(path.read_text())
    target = path.with_name("altered.json")
    target.write_text(json.dumps(replaced(document, ("loop", "gains", 1), "7"), indent=1))
    command = [sys.executable, "-m", "mrac_design.verify", str(target)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    line = next(k for k, t in enumerate(target.read_text().splitlines(), 1) if t.strip() == '"7",')
    assert f"{target}:{line}: /loop/gains/1: this value or its seal" in done.stderr


def test_nothing_is_written_without_a_proof(tmp_path) -> None:
    loop = rst_loop(500, 50)
    refuted = certify(loop, relative_box(loop, "0.8", (800, 1200)), Continuous())
    with pytest.raises(CertificateError, match="unstable"):
        write_certificate(refuted, tmp_path / "certificate.json")
    assert not list(tmp_path.iterdir())


def test_the_hash_ties_the_certificate_to_the_gains(path) -> None:
    document = json.loads(path.read_text())
    assert sum(document["gains_hash"] == gains_hash(loop) for loop, _, _ in CASES.values()) == 1


def test_the_document_of_a_proof_needs_no_file() -> None:
    loop = rst_loop(500, 50)
    proved = certify(loop, relative_box(loop, 0, (800, 800)), Continuous())
    assert certificate_document(proved)["claims"]
