"""`certificate.json`: a certificate as rationals in strings, checkable without this package.

The checker is `mrac_design.verify`, which shares no code with what made the certificate. The seal
holds a digest of every number, so that an altered one is named; the proof itself does not rest on
it, since the checker decides every matrix inequality anew.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import jsonschema
from flint import fmpq

from mrac_design.errors import CertificateError
from mrac_design.stability.adaptive_loop import AdaptiveLoop, ExactArray
from mrac_design.stability.certificate import StabilityCertificate
from mrac_design.stability.claims import Claim, DecayClaim, EnergyClaim
from mrac_design.stability.sampled_loop import Sampling, energy_input, velocity_exponential
from mrac_design.verdict import Verdict

FORMAT = "mrac-design stability certificate 2"
"""Name and version of the format."""


def certificate_document(certificate: StabilityCertificate) -> dict[str, Any]:
    """The JSON document of a proved certificate.

    Raises CertificateError when the certificate is not proved or fails its own exact check.
    """
    failure = certificate.verify() if certificate.verdict is Verdict.PROVED else certificate.reason
    if failure is not None:
        raise CertificateError(failure)
    loop, box = certificate.loop, certificate.box
    document: dict[str, Any] = {
        "format": FORMAT,
        "gains_hash": gains_hash(loop),
        "loop": _loop(loop),
        "box": {
            "lower": _strings(box.lower),
            "upper": _strings(box.upper),
            "stiffness_ratio": _strings(box.stiffness_ratio),
        },
        "timing": _timing(certificate),
        "claims": [_claim(claim) for claim in certificate.claims],
    }
    document["seal"] = {pointer: digest(pointer, value) for pointer, value in _leaves(document)}
    return document


def write_certificate(certificate: StabilityCertificate, path: Path) -> None:
    """Write `certificate.json`. Raises CertificateError when nothing is proved."""
    document = certificate_document(certificate)
    jsonschema.validate(document, certificate_schema())
    path.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def certificate_schema() -> dict[str, Any]:
    """The JSON schema of the format."""
    text = (files("mrac_design.stability") / "certificate.schema.json").read_text("utf-8")
    schema: dict[str, Any] = json.loads(text)
    return schema


def gains_hash(loop: AdaptiveLoop) -> str:
    """SHA-256 of the axis and its nominal gains, in hexadecimal: lines `name=rational`, several
    rationals of a name with a space between, sorted by name."""
    numbers = _loop(loop)
    lines = (
        f"{name}={value if isinstance(value, str) else ' '.join(value)}\n"
        for name, value in sorted(numbers.items())
    )
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def digest(pointer: str, value: str) -> str:
    """First 16 hexadecimal digits of the SHA-256 of a value and its place."""
    return hashlib.sha256(f"{pointer}\n{value}".encode()).hexdigest()[:16]


def _loop(loop: AdaptiveLoop) -> dict[str, str | list[str]]:
    return {
        "bandwidth": str(loop.bandwidth),
        "design_stiffness": str(loop.design_stiffness),
        "gain_scale": _strings(loop.gain_scale),
        "gains": _strings(loop.gains),
        "internal_model": _strings(loop.internal_model),
        "observer": _strings(loop.observer),
        "velocity_gain": str(loop.velocity_gain),
    }


def _timing(certificate: StabilityCertificate) -> dict[str, Any]:
    loop, timing = certificate.loop, certificate.timing
    if not isinstance(timing, Sampling):
        return {"kind": "continuous"}
    bounds, step = velocity_exponential(loop, timing), loop.filter_step(timing.period)
    return {
        "kind": "sampled",
        "period": str(timing.period),
        "delay": str(timing.delay),
        "velocity_exponential": _strings(bounds),
        "observer_transition": [_strings(row) for row in step.transition],
        "observer_input": _strings(step.input),
        "energy_input": _matrix(energy_input(loop, timing, bounds)),
    }


def _claim(claim: Claim) -> dict[str, Any]:
    if isinstance(claim, DecayClaim):
        numbers: dict[str, Any] = {"claim": "decay", "rate": str(claim.rate)}
    elif isinstance(claim, EnergyClaim):
        numbers = {"claim": f"energy of {claim.output.value}", "gain": str(claim.gain)}
    else:
        numbers = {"claim": "peak of force", "rate": str(claim.rate), "gain": str(claim.gain)}
    return numbers | {"P": _matrix(claim.P)}


def _leaves(value: Any, pointer: str = "") -> Iterator[tuple[str, str]]:
    """JSON pointer and text of every leaf."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(inner, f"{pointer}/{key}")
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from _leaves(inner, f"{pointer}/{index}")
    else:
        yield pointer, str(value)


def _strings(values: tuple[fmpq, ...]) -> list[str]:
    return [str(value) for value in values]


def _matrix(matrix: ExactArray) -> list[list[str]]:
    return [[str(value) for value in row] for row in matrix.tolist()]
