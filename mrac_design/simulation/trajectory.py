"""What a simulation returns: named signals with units over a common time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mrac_design.arrays import FloatArray, readonly

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trajectory:
    """Recorded signals of one run."""

    time: FloatArray
    """Recording instants (s), shape (N,)."""
    signals: Mapping[str, Signal]
    """Signals by name, all of length N."""
    engine: str
    """The machine that ran it."""

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
        return dataset
