"""Safeguards of an adaptation law that a scenario can name, from the inside out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from mrac_design.controller.adaptation import AdaptationLaw
from mrac_design.controller.robust import (
    GainBox,
    WithDeadZone,
    WithErrorLeakage,
    WithLeakage,
    WithProjection,
)
from mrac_design.errors import ParameterError
from mrac_design.strict_toml import Table


class Safeguard(Protocol):
    """One wrapper of a law."""

    def wrap(self, law: AdaptationLaw, nominal: tuple[float, ...]) -> AdaptationLaw:
        """The law inside the wrapper; `nominal` are the design's scaled gains."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Projection:
    """Gains kept within a share of their nominal values: the box a certificate covers."""

    share: float
    """Largest relative deviation of each gain of R, S and T, ≥ 0."""
    bias: float
    """Largest |scaled bias gain|, ≥ 0."""

    def __post_init__(self) -> None:
        for name in ("share", "bias"):
            _require_not_negative(name, getattr(self, name))

    def wrap(self, law: AdaptationLaw, nominal: tuple[float, ...]) -> AdaptationLaw:
        box = GainBox.around(nominal, fraction=self.share)
        limits = GainBox(lower=(*box.lower, -self.bias), upper=(*box.upper, self.bias))
        return WithProjection(law=law, box=limits)


@dataclass(frozen=True, slots=True, kw_only=True)
class DeadZone:
    """Errors that noise could explain are ignored."""

    width: float
    """Largest |ε| that is ignored (N), ≥ 0."""

    def __post_init__(self) -> None:
        _require_not_negative("width", self.width)

    def wrap(self, law: AdaptationLaw, nominal: tuple[float, ...]) -> AdaptationLaw:
        return WithDeadZone(law=law, width=self.width)


@dataclass(frozen=True, slots=True, kw_only=True)
class Leakage:
    """A constant pull towards the nominal gains (σ-modification)."""

    rate: float
    """σ (1/s), ≥ 0."""

    def __post_init__(self) -> None:
        _require_not_negative("rate", self.rate)

    def wrap(self, law: AdaptationLaw, nominal: tuple[float, ...]) -> AdaptationLaw:
        return WithLeakage(law=law, leakage=self.rate, centre=nominal)


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorLeakage:
    """A pull towards the nominal gains in step with the error (e-modification)."""

    rate: float
    """ν (1/(N·s)), ≥ 0."""

    def __post_init__(self) -> None:
        _require_not_negative("rate", self.rate)

    def wrap(self, law: AdaptationLaw, nominal: tuple[float, ...]) -> AdaptationLaw:
        return WithErrorLeakage(law=law, leakage=self.rate, centre=nominal)


SAFEGUARDS: Mapping[str, type[Safeguard]] = {
    "projection": Projection,
    "dead_zone": DeadZone,
    "leakage": Leakage,
    "error_leakage": ErrorLeakage,
}
"""Safeguards by the word a scenario file uses."""


def wrapped(
    law: AdaptationLaw, safeguards: Sequence[Safeguard], nominal: tuple[float, ...]
) -> AdaptationLaw:
    """The law inside all `safeguards`, the first one innermost.

    Raises ParameterError when one of them is named twice.
    """
    for safeguard in safeguards:
        law = safeguard.wrap(law, nominal)
    law.parameters(len(nominal) + 1)
    return law


def read_safeguards(table: Table) -> tuple[Safeguard, ...]:
    """The array `safeguards` of an [adaptation] table; it may be empty."""
    if table.entries["safeguards"] == []:
        return ()
    return tuple(_safeguard(entry) for entry in table.tables("safeguards"))


def safeguard_entries(safeguards: Sequence[Safeguard]) -> list[dict[str, Any]]:
    """The array as plain data."""
    words = {kind: word for word, kind in SAFEGUARDS.items()}
    return [
        {
            "kind": words[type(safeguard)],
            **{name: getattr(safeguard, name) for name in type(safeguard).__dataclass_fields__},  # type: ignore[attr-defined]
        }
        for safeguard in safeguards
    ]


def _safeguard(table: Table) -> Safeguard:
    if "kind" not in table.entries:
        table.only("kind")
    kind = table.choice("kind", SAFEGUARDS)
    names = tuple(kind.__dataclass_fields__)  # type: ignore[attr-defined]
    table.only("kind", *names)
    constructor: Callable[..., Safeguard] = kind
    return table.build(lambda: constructor(**{name: table.number(name) for name in names}))


def _require_not_negative(name: str, value: float) -> None:
    if not 0 <= value < float("inf"):
        raise ParameterError(name, value, "must be finite and >= 0")
