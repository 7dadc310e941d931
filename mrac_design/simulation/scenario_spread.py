"""Runs drawn around a scenario: tissue, bodies of the true robot, adaptation gain, heart motion."""

from __future__ import annotations

import io
import pickle
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from mrac_design.arrays import FloatArray
from mrac_design.motion import DualFourierModel, HeartMotion
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.lanes import Case
from mrac_design.simulation.sampling_choices import SampledMeasurement
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.scenario_inputs import rest_depth, scenario_inputs


class MotionSource(Protocol):
    """The motions runs pick from."""

    @property
    def count(self) -> int:
        """How many there are."""

    def motion(self, number: int, duration: float) -> HeartMotion:
        """Motion 0 … count − 1 over [0, duration] s."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeededMotions:
    """One model's motions with successive seeds, its own seed first."""

    model: DualFourierModel
    """The model."""
    count: int
    """Number of seeds."""

    def motion(self, number: int, duration: float) -> HeartMotion:
        """See `MotionSource`."""
        return self.model.with_seed(self.model.seed + number).motion(duration)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OneMotion:
    """The same motion for all, as a recording gives it."""

    recorded: HeartMotion
    """The motion."""
    count: int = 1
    """One."""

    def motion(self, number: int, duration: float) -> HeartMotion:
        """See `MotionSource`."""
        return self.recorded


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScenarioSpread:
    """Draws runs around a scenario's own: a sampler for `Ensemble`, small enough to be sent.

    Motions are made where they are needed. The heart lies so that every tissue carries the first
    reference at the beginning, as in a run of the scenario itself.
    """

    scenario: Scenario
    """The nominal choices."""
    motions: MotionSource
    """Heart motions."""
    axes: tuple[int, ...]
    """Components of the task that are force axes."""
    tip: FloatArray
    """Task position of the tip at home (m), shape (k,)."""
    parameters: FloatArray
    """Nominal parameters of the loop."""
    initial_state: FloatArray
    """State at time 0."""
    held: FloatArray | None
    """Memory at time 0."""
    stiffness_places: tuple[int, ...]
    """Entries of the parameters that are Ks."""
    body_places: tuple[tuple[int, ...], ...]
    """Entries that belong to each body of the true robot."""
    gain_places: tuple[int, ...]
    """Entries proportional to γ̂."""
    stiffness_range: tuple[float, float]
    """Limits of Ks (N/m)."""
    gain_range: tuple[float, float]
    """Limits of γ̂."""
    inertia_spread: float
    """Largest relative change of a body."""
    _made: dict[int, PiecewisePolynomial] = field(default_factory=dict, init=False, repr=False)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of what `draw` returns."""
        bodies = (f"body_scale[{i}]" for i in range(len(self.body_places)))
        return ("stiffness", "adaptation_gain", "motion", *bodies)

    def draw(self, random: np.random.Generator) -> FloatArray:
        """Ks (N/m), γ̂, number of the motion, and a factor for each body, shape (columns,)."""
        low, high = np.log(self.gain_range)
        spread = self.inertia_spread
        stiffness = random.uniform(*self.stiffness_range)
        gain = np.exp(random.uniform(low, high)) if self.gain_places else 0.0
        motion = random.integers(self.motions.count)
        bodies = random.uniform(1 - spread, 1 + spread, len(self.body_places))
        return np.array([stiffness, gain, motion, *bodies])

    def __call__(self, run: int, random: np.random.Generator) -> Case:
        """The case of a run, from its generator alone."""
        stiffness, gain, motion, *bodies = self.draw(random)
        parameters = np.array(self.parameters)
        parameters[list(self.stiffness_places)] = stiffness
        parameters[list(self.gain_places)] *= gain / self.scenario.adaptation.gain
        for places, factor in zip(self.body_places, bodies, strict=True):
            parameters[list(places)] *= factor
        return Case(
            parameters=parameters,
            initial_state=self.initial_state,
            inputs=self._inputs(int(motion), stiffness),
            held=self.held,
        )

    def _inputs(self, motion: int, stiffness: float) -> PiecewisePolynomial:
        """Inputs over a motion, the heart where this tissue carries the first reference."""
        if motion not in self._made:
            self._made[motion] = self._nominal_inputs(motion)
        nominal, scenario = self._made[motion], self.scenario
        moved = np.zeros(nominal.channels)
        moved[: len(self.axes)] = rest_depth(scenario, scenario.stiffness) - rest_depth(
            scenario, stiffness
        )
        return nominal.shifted(moved)

    def _nominal_inputs(self, motion: int) -> PiecewisePolynomial:
        scenario, sampling = self.scenario, self.scenario.sampling
        if isinstance(sampling, SampledMeasurement):
            sensor = replace(sampling.force_sensor, seed=sampling.force_sensor.seed + motion)
            scenario = replace(scenario, sampling=replace(sampling, force_sensor=sensor))
        made = self.motions.motion(motion, scenario.simulation.duration)
        return scenario_inputs(scenario, made, axes=self.axes, tip=self.tip)

    def __getstate__(self) -> bytes:
        # Neither shared objects nor flags of arrays are noted (protocol 5 would): equal spreads
        # have equal bytes whoever made them, so a store knows its ensemble again.
        buffer = io.BytesIO()
        pickler = pickle.Pickler(buffer, protocol=4)
        pickler.fast = True
        names = self.__dataclass_fields__
        pickler.dump({name: getattr(self, name) for name in names if name != "_made"})
        return buffer.getvalue()

    def __setstate__(self, state: bytes) -> None:
        for name, value in {**pickle.loads(state), "_made": {}}.items():
            object.__setattr__(self, name, value)
