"""What a simulation returns: named signals with units over a common time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mrac_design.arrays import FloatArray, readonly
from mrac_design.simulation.system import Event

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Signal:
    """One recorded quantity."""

    values: FloatArray
    """Samples, shape (N, len(labels))."""
    unit: str
    """SI unit, "1" if it has none."""
    labels: tuple[str, ...]
    """Name of each column: an axis, a motor, a gain of an axis."""
    description: str
    """What it is, for people."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", readonly(self.values, (-1, len(self.labels))))


@dataclass(frozen=True, slots=True, kw_only=True)
class Occurrence:
    """One event of a run."""

    time: float
    """Instant (s)."""
    event: Event
    """What changed."""
    rises: bool
    """Whether the event function has become positive, else it no longer is."""

    @property
    def change(self) -> str:
        """What has happened, e.g. "lost"."""
        return self.event.rising if self.rises else self.event.falling


_TOLD_ONE_BY_ONE = 4


def event_texts(events: Sequence[Occurrence], *, duration: float) -> tuple[str, ...]:
    """A line for people on everything that changed in a run of `duration` (s).

    Few changes are told one by one, many as their number and share of time.
    """
    by_event: dict[Event, list[Occurrence]] = {}
    for occurrence in events:
        by_event.setdefault(occurrence.event, []).append(occurrence)
    texts = []
    for event, changes in by_event.items():
        if len(changes) <= _TOLD_ONE_BY_ONE:
            instants = ", ".join(f"{change.change} {change.time:.3f} s" for change in changes)
            texts.append(f"{event.name} {instants}")
            continue
        falls = sum(not change.rises for change in changes)
        share = 100 * _time_fallen(changes, duration) / duration
        texts.append(f"{event.name} {event.falling} {falls} times, {share:.2g} % of the time")
    return tuple(texts)


def _time_fallen(changes: Sequence[Occurrence], duration: float) -> float:
    """Time (s) from falls to the rises after them; before the first change it was the other way."""
    total, fallen_since = 0.0, 0.0 if changes[0].rises else None
    for change in changes:
        if change.rises and fallen_since is not None:
            total += change.time - fallen_since
            fallen_since = None
        elif not change.rises:
            fallen_since = change.time
    return total if fallen_since is None else total + duration - fallen_since


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trajectory:
    """Recorded signals of one run."""

    time: FloatArray
    """Recording instants (s), shape (N,)."""
    signals: Mapping[str, Signal]
    """Signals by name, all of length N."""
    engine: str
    """The machine that ran it."""
    events: tuple[Occurrence, ...] = ()
    """What happened between the samples, in order of time."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "time", readonly(self.time, (-1,)))
        assert all(signal.values.shape[0] == self.time.size for signal in self.signals.values())

    def __getitem__(self, name: str) -> FloatArray:
        """Samples of the signal `name`, shape (N, columns)."""
        return self.signals[name].values

    def to_xarray(self) -> xarray.Dataset:
        """The same as an xarray dataset: one variable a signal, with units in its attributes."""
        import xarray

        variables = {
            name: xarray.DataArray(
                signal.values,
                dims=("time", f"{name}_component"),
                coords={"time": self.time, f"{name}_component": list(signal.labels)},
                attrs={"units": signal.unit, "long_name": signal.description},
            )
            for name, signal in self.signals.items()
        }
        dataset = xarray.Dataset(variables, attrs={"engine": self.engine})
        dataset["time"].attrs["units"] = "s"
        if self.events:
            instants = [occurrence.time for occurrence in self.events]
            texts = [f"{occurrence.event.name} {occurrence.change}" for occurrence in self.events]
            dataset["event"] = xarray.DataArray(
                texts, dims=("event_time",), coords={"event_time": instants}
            )
            dataset["event_time"].attrs["units"] = "s"
        return dataset
