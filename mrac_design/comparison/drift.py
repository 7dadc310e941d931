"""Half an hour on one axis: how far the gains drift, and what each safeguard makes of it.

Sensor noise and the heart's motion enter both the regressor φ̂ and the error ε, so E[φ̂ε] is not
zero and the gains move although no gain removes either (Ioannou & Sun 1996, ch. 8; Anderson 1985 on
bursting). Here the
sampled axis rests at a constant small force and, if wanted, works under force steps for the last
minutes of every cycle, minute by minute for as long as asked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.comparison.bench import with_quantised_force
from mrac_design.comparison.drift_cases import MINUTE, STILL, DriftCase, GuardedLaw
from mrac_design.controller.adaptation import NormalisedGradientLaw
from mrac_design.controller.adaptive import AdaptiveRST, build_step, nominal_gains
from mrac_design.controller.reference import ModelInverse
from mrac_design.design import RSTDesign
from mrac_design.errors import ParameterError, SimulationError
from mrac_design.motion import AXES, find_model, quintic_hermite
from mrac_design.motion.dual_fourier import NODE_SPACING
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.engine import Engine
from mrac_design.simulation.run import RunSettings, run
from mrac_design.simulation.safeguards import wrapped
from mrac_design.simulation.sampling_choices import SampledMeasurement
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.single_axis import (
    AxisLoop,
    axis_inputs,
    build_axis_engine,
    build_sampled_axis_loop,
    resting_axis,
)
from mrac_design.study import scenario_design

ADAPTED = 5
"""Gains that adapt: (r1', s0, s1, t0, t1); the constant regressor is left out."""

Progress = Callable[[str, float], None]
"""Called with what is running and the share of all work, 0 to 1."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DriftRun:
    """One condition, minute by minute; numbers end with the minute in which the loop was lost."""

    case: DriftCase
    """What was run."""
    gains: FloatArray
    """Scaled gains at the end of each minute, (minutes, 5)."""
    strayed: FloatArray
    """Largest |scaled gain − nominal| within each minute, (minutes,)."""
    rms: FloatArray
    """Rms force error of each minute (N), (minutes,)."""
    largest: FloatArray
    """Largest |force error| of each minute (N), (minutes,)."""
    lost: int | None
    """Minute 0, 1, … in which the loop left the range of numbers; None if it did not."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "gains", readonly(self.gains, (-1, ADAPTED)))
        for name in ("strayed", "rms", "largest"):
            object.__setattr__(self, name, readonly(getattr(self, name), (-1,)))

    def minutes(self, *, work: bool) -> FloatArray:
        """Indices of the finished minutes of work, or of rest."""
        return np.array(
            [k for k in range(self.rms.size) if self.case.programme.works(k) == work], dtype=int
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DriftBench:
    """One axis of a scenario with a sampled controller; what was compiled serves again."""

    scenario: Scenario
    """Design, sensor, timing, adaptation and tissue."""
    axis: str = "Z"
    """Axis of the motion: X, Y or Z."""
    _engines: dict[str, Engine] = field(default_factory=dict)
    _hearts: dict[str, tuple[PiecewisePolynomial, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        scenario = self.scenario
        if not isinstance(scenario.sampling, SampledMeasurement):
            raise ParameterError(
                "scenario", scenario.name, "needs a sampled controller, as 'reality_degree_one' has"
            )
        if scenario.adaptation.law != "normalised":
            raise ParameterError("law", scenario.adaptation.law, "must be the normalised one")
        if self.axis not in AXES:
            raise ParameterError("axis", self.axis, f"must be one of {', '.join(AXES)}")

    @property
    def design(self) -> RSTDesign:
        """The scenario's RST design."""
        return scenario_design(self.scenario)

    @property
    def nominal(self) -> FloatArray:
        """Scaled gains of the design, (5,)."""
        return readonly(nominal_gains(self.design))

    def run(
        self,
        case: DriftCase,
        minutes: int,
        *,
        gain: float | None = None,
        start: Sequence[float] | FloatArray | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> DriftRun:
        """Run a condition for that many minutes, from `start` (scaled gains) or from nominal.

        `gain` replaces the scenario's γ̂.
        """
        loop = self._loop(case.law, gain, self.nominal if start is None else start)
        sensor = self.measurement.force_sensor
        random = np.random.default_rng(sensor.seed)
        state: FloatArray | None = None
        held: FloatArray | None = None
        rows: list[tuple[FloatArray, float, float, float]] = []
        lost: int | None = None
        for minute, heart in enumerate(self._minutes(case.motion, minutes)):
            inputs = axis_inputs(
                loop.step,
                heart=heart,
                reference=case.programme.reference(minute),
                noise=self._noise(random),
                end=MINUTE,
            )
            if state is None or held is None:
                first = inputs([0.0])[:, 0]
                state, held = resting_axis(loop, force=float(first[1]), heart=float(first[0]))
            try:
                state, held, row = self._minute(loop, inputs, state, held)
            except SimulationError:
                lost = minute
                break
            rows.append(row)
            if progress is not None:
                progress((minute + 1) / minutes)
        gains, strayed, rms, largest = zip(*rows, strict=True) if rows else ([], [], [], [])
        return DriftRun(
            case=case,
            gains=np.reshape(gains, (-1, ADAPTED)),
            strayed=np.array(strayed),
            rms=np.array(rms),
            largest=np.array(largest),
            lost=lost,
        )

    def averaged_drift(self, case: DriftCase, gains: Sequence[float] | FloatArray) -> FloatArray:
        """Mean of φ̂ε/(α + φ̂ᵀφ̂) over a minute while the gains stay there (1/N), (5,).

        It is what dθ̂/dt = γ̂ω E[φ̂ε/(α + φ̂ᵀφ̂)] moves along for a small γ̂, measured with
        one so small that the gains do not move. Source: averaging [AW 6].
        """
        slow = 1e-7
        found = self.run(case, 1, gain=slow, start=gains)
        if found.lost is not None:
            raise SimulationError("with those gains held the loop is unstable: there is no mean")
        omega = self.scenario.design.bandwidth
        return readonly((found.gains[-1] - np.asarray(gains)) / (slow * omega * MINUTE))

    @property
    def measurement(self) -> SampledMeasurement:
        """How the scenario samples and measures."""
        assert isinstance(self.scenario.sampling, SampledMeasurement)
        return self.scenario.sampling

    def _loop(
        self, law: GuardedLaw, gain: float | None, start: Sequence[float] | FloatArray
    ) -> AxisLoop:
        adaptation, design, timing = self.scenario.adaptation, self.design, self.measurement
        plain = NormalisedGradientLaw(
            gain=adaptation.gain if gain is None else gain, alpha=adaptation.normalisation
        )
        step = build_step(
            AdaptiveRST(
                design=design,
                prefilter=self.scenario.prefilter,
                law=wrapped(plain, law.safeguards, nominal_gains(design)),
                feedforward=ModelInverse(),
                bias_force=0.0,
                initial_gains=tuple(float(value) for value in start),
                time_domain=timing.domain,
            )
        )
        return build_sampled_axis_loop(
            with_quantised_force(step, timing.force_sensor.resolution),
            velocity_gain=design.specification.plant.velocity_gain,
            stiffness=self.scenario.stiffness,
            period=timing.domain.period,
            delay=timing.delay,
        )

    def _minutes(self, motion: str, minutes: int) -> tuple[PiecewisePolynomial, ...]:
        """The heart (m) over each minute, every one counted from 0 s."""
        if motion == STILL:
            borders = np.array([0.0, MINUTE])
            still = PiecewisePolynomial(breakpoints=borders, coefficients=np.zeros((1, 1, 1)))
            return (still,) * minutes
        if len(self._hearts.get(motion, ())) != minutes:
            self._hearts[motion] = tuple(self._generated(motion, minutes))
        return self._hearts[motion]

    def _generated(self, motion: str, minutes: int) -> Iterator[PiecewisePolynomial]:
        """Minutes of a motion model, one at a time: half an hour at once takes gigabytes."""
        model, row = find_model(motion), [AXES.index(self.axis)]
        nodes = np.linspace(0.0, MINUTE, round(MINUTE / NODE_SPACING) + 1)
        for minute in range(minutes):
            # The last instant stays the same, so all minutes belong to one row of beats.
            instants = np.append(minute * MINUTE + nodes, (minutes + 1) * MINUTE)
            jet = model.displacement(instants)
            yield quintic_hermite(
                nodes, jet.value[row, :-1], jet.rate[row, :-1], jet.second_rate[row, :-1]
            )

    def _noise(self, random: np.random.Generator) -> PiecewisePolynomial:
        """A minute of the sensor's noise (N)."""
        count = round(MINUTE / self.measurement.domain.period)
        return PiecewisePolynomial(
            breakpoints=np.linspace(0.0, MINUTE, count + 1),
            coefficients=self.measurement.force_sensor.noise
            * random.standard_normal((1, count, 1)),
        )

    def _minute(
        self, loop: AxisLoop, inputs: PiecewisePolynomial, state: FloatArray, held: FloatArray
    ) -> tuple[FloatArray, FloatArray, tuple[FloatArray, float, float, float]]:
        period = self.measurement.domain.period
        form = f"{loop.step.command.serialize()}{loop.step.advance.serialize()}{inputs.degree}"
        if form not in self._engines:
            self._engines[form] = build_axis_engine(loop, inputs)
        recording = run(
            self._engines[form],
            loop.system,
            inputs=inputs,
            parameters=loop.parameter_values,
            initial_state=state,
            initial_held=held,
            settings=RunSettings(duration=MINUTE, step=period, record_period=period),
        )
        signals = loop.system.outputs.slices
        outputs = recording.outputs
        error = outputs[:, signals["force"]] - outputs[:, signals["desired_force"]]
        gains = outputs[:, signals["adapted_gains"]][:, :ADAPTED]
        row = (
            gains[-1],
            float(np.abs(gains - self.nominal).max()),
            float(np.sqrt(np.mean(error**2))),
            float(np.abs(error).max()),
        )
        return recording.final_state, recording.final_held, row


def drift_runs(
    bench: DriftBench,
    cases: Sequence[DriftCase],
    minutes: int,
    *,
    progress: Progress = lambda message, share: None,
) -> tuple[DriftRun, ...]:
    """Every case in turn; raises ParameterError unless there is a minute to run."""
    if minutes < 1:
        raise ParameterError("minutes", minutes, "must be at least 1")
    runs = []
    for number, case in enumerate(cases):

        def done(share: float, number: int = number, case: DriftCase = case) -> None:
            progress(f"{case.law.title}, {case.motion}", (number + share) / len(cases))

        runs.append(bench.run(case, minutes, progress=done))
    return tuple(runs)
