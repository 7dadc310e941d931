"""What a scenario says about when and how the controller measures, and what it builds from that."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from mrac_design.errors import ParameterError
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.encoder import Encoder, ExactJoints, JointSensor
from mrac_design.simulation.sensor import (
    FineReading,
    ForceSensing,
    ForceSensor,
    UniformQuantiser,
    WithFlexibleMode,
    gaussian_noise,
)
from mrac_design.strict_toml import Table
from mrac_design.time_domain import Continuous, Discrete


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceSensorChoice:
    """The force sensor."""

    noise: float
    """Standard deviation of the white noise of a reading (N)."""
    bias: float
    """Constant error of all readings (N)."""
    resolution: float
    """Step between readings (N); 0 leaves quantisation out."""
    decimation: int
    """The controller's samples per reading."""
    mode_frequency: float
    """Natural frequency of the sensor's elastic body (Hz); 0 leaves it out."""
    mode_damping: float
    """ζ of that mode; not used without it."""
    seed: int
    """Seed of the noise: the same seed, the same noise."""

    def __post_init__(self) -> None:
        if not (abs(self.bias) < float("inf")):
            raise ParameterError("bias", self.bias, "must be a finite force in N")
        if self.resolution < 0 or self.mode_frequency < 0:
            name = "resolution" if self.resolution < 0 else "mode_frequency"
            raise ParameterError(name, getattr(self, name), "must be >= 0 (0 leaves it out)")
        if not (isinstance(self.seed, int) and self.seed >= 0):
            raise ParameterError("seed", self.seed, "must be a whole number >= 0")
        self.build()
        self.errors(axes=1, period=1.0, duration=1.0)

    def build(self) -> ForceSensing:
        """The sensor without its noise, which is an input of the loop."""
        quantiser = (
            UniformQuantiser(resolution=self.resolution) if self.resolution else FineReading()
        )
        sensor: ForceSensing = ForceSensor(decimation=self.decimation, quantiser=quantiser)
        if self.mode_frequency:
            sensor = WithFlexibleMode(
                sensor=sensor, frequency=self.mode_frequency, damping=self.mode_damping
            )
        return sensor

    def errors(self, *, axes: int, period: float, duration: float) -> PiecewisePolynomial:
        """Noise and bias of `axes` channels (N) over [0, duration] s."""
        noise = gaussian_noise(
            deviation=[self.noise] * axes, period=period, duration=duration, seed=self.seed
        )
        return noise.shifted(self.bias)


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderChoice:
    """The joint sensors."""

    counts_per_turn: float
    """Counts a turn of each motor; 0: positions and velocities are known exactly."""
    velocity_cutoff: float
    """Cutoff of the velocity's low-pass (rad/s); not used without counts."""

    def __post_init__(self) -> None:
        self.build()

    def build(self) -> JointSensor:
        """The joint sensors."""
        if self.counts_per_turn == 0:
            return ExactJoints()
        return Encoder(counts_per_turn=self.counts_per_turn, velocity_cutoff=self.velocity_cutoff)


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledMeasurement:
    """The controller runs at a fixed rate on imperfect measurements, its torque held."""

    rate: float
    """Sample rate (Hz)."""
    delay: int
    """Whole samples between a measurement and the instant its torque acts."""
    force_sensor: ForceSensorChoice
    """The force sensor."""
    encoder: EncoderChoice
    """The joint sensors."""

    def __post_init__(self) -> None:
        if not 0 < self.rate < float("inf"):
            raise ParameterError("rate", self.rate, "must be a finite rate > 0 Hz")
        # Loaded where it is used: with every loop and engine, of which a choice knows nothing.
        from mrac_design.simulation.sampled_loop import ComputationalDelay

        ComputationalDelay(self.delay)

    @property
    def domain(self) -> Discrete:
        """The controller's time domain."""
        return Discrete(1 / self.rate)


Sampling = Continuous | SampledMeasurement
"""A continuous controller measures everything exactly; a sampled one as its choice says."""


def read_sampling(table: Table) -> Sampling:
    """The [sampling] table."""
    if "kind" not in table.entries:
        table.only("kind")
    reader = table.choice("kind", _READERS)
    return reader(table)


def sampling_entries(sampling: Sampling) -> dict[str, Any]:
    """The [sampling] table as plain data."""
    if isinstance(sampling, Continuous):
        return {"kind": "continuous"}
    return {
        "kind": "sampled",
        "rate": sampling.rate,
        "delay": sampling.delay,
        "force_sensor": _entries(sampling.force_sensor),
        "encoder": _entries(sampling.encoder),
    }


def _continuous(table: Table) -> Sampling:
    table.only("kind")
    return Continuous()


def _sampled(table: Table) -> Sampling:
    table.only("kind", "rate", "delay", "force_sensor", "encoder")
    sensor, encoder = table.table("force_sensor"), table.table("encoder")
    sensor.only(*ForceSensorChoice.__dataclass_fields__)
    encoder.only(*EncoderChoice.__dataclass_fields__)
    whole = ("decimation", "seed")
    force_sensor = sensor.build(
        lambda: ForceSensorChoice(
            **{name: _number(sensor, name, whole=name in whole) for name in sensor.entries}
        )
    )
    joints = encoder.build(
        lambda: EncoderChoice(**{name: encoder.number(name) for name in encoder.entries})
    )
    return table.build(
        lambda: SampledMeasurement(
            rate=table.number("rate"),
            delay=_number(table, "delay", whole=True),
            force_sensor=force_sensor,
            encoder=joints,
        )
    )


_READERS: Mapping[str, Callable[[Table], Sampling]] = {
    "continuous": _continuous,
    "sampled": _sampled,
}


def _number(table: Table, key: str, *, whole: bool) -> Any:
    value = table.number(key)
    if not whole:
        return value
    if value != int(value):
        raise table.error(key, f"needs a whole number, got {value:g}")
    return int(value)


def _entries(section: object) -> dict[str, Any]:
    return {name: getattr(section, name) for name in section.__dataclass_fields__}  # type: ignore[attr-defined]
