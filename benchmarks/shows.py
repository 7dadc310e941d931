"""What this package claims against its peers, as measured ratios."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from benchmarks import terms
from benchmarks.closed_loop import OWN
from benchmarks.measure import Ratio, Result


@dataclass(frozen=True, slots=True)
class Show:
    """One claim."""

    claim: str
    """What is compared."""
    ratio: Ratio
    """As measured."""
    wanted: float
    """The bound."""
    at_most: bool = False
    """Whether it is an upper bound."""
    setting: str = ""
    """Whose times they are."""

    @property
    def holds(self) -> bool:
        """Whether the median keeps the bound."""
        return (
            self.ratio.median <= self.wanted if self.at_most else self.ratio.median >= self.wanted
        )


def equal_error(peer: Result, results: Sequence[Result]) -> Result | None:
    """This package's fastest setting whose error is no larger than the peer's."""
    assert peer.error is not None
    own = [
        r for r in results
        if r.name.startswith(OWN) and r.error is not None and r.error <= peer.error
    ]  # fmt: skip
    return min(own, key=lambda r: r.cost, default=None)


def terms_shows(results: Sequence[Result]) -> Iterator[Show]:
    """Claims on the rigid-body terms."""
    by_name = {r.name: r for r in results}
    peers = [by_name[name] for name in (terms.MUJOCO, terms.PINOCCHIO) if name in by_name]
    scalar, lanes = by_name[terms.OURS], by_name[terms.OURS_LANES]
    if peers:
        fastest = min(peers, key=lambda r: r.cost)
        yield Show(f"terms: {fastest.name} over scalar", Ratio.of(fastest, scalar), 5)
        yield Show(f"terms: {fastest.name} over 8 lanes", Ratio.of(fastest, lanes), 20)
    limit = Ratio.of(lanes, by_name[terms.LIMIT_LANES])
    yield Show("terms: 8 lanes over the floating-point limit", limit, 2, at_most=True)


_WANTED = {
    "single": (("heyoka", 1.0), ("CasADi external", 5.0), ("python-control", 1000.0)),
    "many": (("heyoka", 1.5), ("CasADi external", 20.0)),
}


def loop_shows(section: str, results: Sequence[Result]) -> Iterator[Show]:
    """Claims on the closed loop: each peer's time over this package's at no larger error."""
    title = "one run" if section == "single" else "one of many"
    for result in results:
        for name, wanted in _WANTED[section]:
            if not result.name.startswith(name):
                continue
            own = equal_error(result, results)
            if own is not None:
                yield Show(
                    f"{title}: {result.name}",
                    Ratio.of(result, own),
                    wanted,
                    setting=f"{own.name.split(', ', 1)[1]} ({own.error:.1e} N)",
                )
