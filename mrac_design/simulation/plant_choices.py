"""What a scenario says about tissue and joints, and the types it builds from that."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from mrac_design.errors import ParameterError
from mrac_design.motion import StepSequence
from mrac_design.simulation.contact import (
    Contact,
    LinearSpring,
    OneSided,
    ScheduledTissue,
    WithDamper,
)
from mrac_design.simulation.friction import Friction, Frictionless, SmoothFriction
from mrac_design.strict_toml import Table

CONTACT_KINDS: Mapping[str, Callable[[Contact], Contact]] = {
    "two_sided": lambda tissue: tissue,
    "one_sided": lambda tissue: OneSided(tissue=tissue),
}
"""Whether the tissue can pull, by the word a scenario file uses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactChoice:
    """What the tissue does beside being a spring."""

    kind: str
    """"two_sided" (it can pull, as in the paper) or "one_sided"."""
    damping: float
    """c of a damper in parallel (N·s/m), Kelvin–Voigt; 0 leaves it out."""
    stiffness_factor: StepSequence
    """Factor on the tissue's forces over time; a single 1 leaves it out."""
    retreat: StepSequence
    """Steps by which the surface retreats from the tool (m); a single 0 leaves it out."""

    def __post_init__(self) -> None:
        if self.kind not in CONTACT_KINDS:
            raise ParameterError("kind", self.kind, f"must be one of {', '.join(CONTACT_KINDS)}")
        self.build(1.0)

    def build(self, stiffness: float) -> Contact:
        """The contact law over a spring of `stiffness` (N/m)."""
        tissue: Contact = LinearSpring(stiffness)
        if self.damping != 0:
            tissue = WithDamper(tissue=tissue, damping=self.damping)
        if self.stiffness_factor.levels != (1.0,):
            tissue = ScheduledTissue(tissue=tissue, factor=self.stiffness_factor)
        return CONTACT_KINDS[self.kind](tissue)


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionChoice:
    """Friction of the joints."""

    scale: float
    """Factor on the robot file's friction; 0 leaves it out."""
    slide_width: float
    """Speed over which Coulomb friction of a prismatic joint is smoothed (m/s)."""
    turn_width: float
    """Speed over which Coulomb friction of a revolute joint is smoothed (rad/s)."""

    def __post_init__(self) -> None:
        SmoothFriction(scale=self.scale, slide_width=self.slide_width, turn_width=self.turn_width)

    def build(self) -> Friction:
        """The friction model."""
        if self.scale == 0:
            return Frictionless()
        return SmoothFriction(
            scale=self.scale, slide_width=self.slide_width, turn_width=self.turn_width
        )


def read_contact(table: Table) -> ContactChoice:
    """The [contact] table without its stiffness."""
    table.choice("kind", CONTACT_KINDS)
    factor = read_steps(table.table("stiffness_factor"))
    retreat = read_steps(table.table("retreat"))
    return table.build(
        lambda: ContactChoice(
            kind=table.text("kind"),
            damping=table.number("damping"),
            stiffness_factor=factor,
            retreat=retreat,
        )
    )


CONTACT_KEYS = ("stiffness", "kind", "damping", "stiffness_factor", "retreat")
"""Keys of the [contact] table."""


def contact_entries(stiffness: float, choice: ContactChoice) -> dict[str, Any]:
    """The [contact] table as plain data."""
    return {
        "stiffness": stiffness,
        "kind": choice.kind,
        "damping": choice.damping,
        "stiffness_factor": step_entries(choice.stiffness_factor),
        "retreat": step_entries(choice.retreat),
    }


def read_steps(table: Table) -> StepSequence:
    """A table of `times` and `levels`."""
    table.only("times", "levels")
    times, levels = table.numbers("times"), table.numbers("levels")
    return table.build(partial(StepSequence, times=tuple(times), levels=tuple(levels)))


def step_entries(steps: StepSequence) -> dict[str, list[float]]:
    """A step sequence as plain data."""
    return {"times": list(steps.times), "levels": list(steps.levels)}
