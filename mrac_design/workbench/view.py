"""What a design panel shows for one set of slider values: a pure function and its picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mrac_design.controller.adaptive import build_step
from mrac_design.design import RSTDesign
from mrac_design.metrics.tracking import TrackingMetrics, tracking_metrics
from mrac_design.motion import AXES, StepSequence
from mrac_design.report.figures_design import draw_heart_sensitivity, draw_poles, loop_on
from mrac_design.report.style import (
    COLOURS,
    CaptionedFigure,
    legend_above,
    line,
    new_figure,
    styled,
)
from mrac_design.simulation.run import RunSettings
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.single_axis import (
    axis_inputs,
    build_axis_engine,
    build_axis_loop,
    simulate_axis,
)
from mrac_design.simulation.trajectory import Trajectory
from mrac_design.study import VARIANTS, scenario_design, scenario_motion, variant_controller

DURATION = 4.0
"""Simulated time of a panel (s): two force steps and a few heartbeats, redrawn in an instant."""

AXIS = "Z"
"""The axis shown: the heart moves most along it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignValues:
    """The numbers a panel's sliders set."""

    velocity_gain: float
    """K2 of the velocity loop (1/s)."""
    bandwidth: float
    """ω of the reference model (rad/s)."""
    damping: float
    """ξ of the reference model (–)."""
    observer_pole: float
    """ao of the observer polynomial p + ao (rad/s); of an observer with several poles their
    geometric mean, all of them moving in proportion."""
    adaptation_gain: float
    """Scaled adaptation gain γ̂; 0 freezes the gains."""
    stiffness: float
    """True stiffness Ks of the tissue (N/m); the design keeps the scenario's."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignView:
    """Design and single-axis response for one set of values."""

    values: DesignValues
    """The values shown."""
    design: RSTDesign
    """The RST design."""
    trajectories: Mapping[str, Trajectory]
    """Response of each variant of the controller on one axis."""
    tracking: Mapping[str, TrackingMetrics]
    """Figures of merit of each variant."""

    @property
    def text(self) -> str:
        """Margins and largest force errors in two sentences."""
        margins = self.design.margins()
        errors = ", ".join(
            f"{variant.title} {self.tracking[variant.name].max_force_error_percent:.3g} %"
            for variant in VARIANTS
        )
        return (
            f"Phase margin {np.degrees(margins.phase_margin):.3g}°, delay margin "
            f"{1e3 * margins.delay_margin:.3g} ms, crossover "
            f"{margins.crossover_frequency:.4g} rad/s. Largest force error: {errors}."
        )

    def _repr_markdown_(self) -> str:
        return self.text


def initial_values(scenario: Scenario) -> DesignValues:
    """The values a scenario states."""
    choice = scenario.design
    return DesignValues(
        velocity_gain=choice.velocity_gain,
        bandwidth=choice.bandwidth,
        damping=choice.damping,
        observer_pole=_mean_pole(choice.observer),
        adaptation_gain=scenario.adaptation.gain,
        stiffness=scenario.stiffness,
    )


def design_view(values: DesignValues, scenario: Scenario) -> DesignView:
    """Design for `values` and simulate one axis; everything else is the scenario's.

    The axis is what exact linearisation leaves of the robot, under the same controllers as the
    whole. Raises ParameterError for values that cannot be, SimulationError when the response
    grows without bound.
    """
    chosen = _with_values(values, scenario)
    design = scenario_design(chosen)
    trajectories = _simulate(chosen, design)
    settling = chosen.simulation.settling
    return DesignView(
        values=values,
        design=design,
        trajectories=trajectories,
        tracking={
            name: next(iter(tracking_metrics(run, settling=settling).values()))
            for name, run in trajectories.items()
        },
    )


@styled()
def view_figure(view: DesignView) -> CaptionedFigure:
    """Poles, sensitivity to the heart's motion, force and force error in one picture."""
    figure = new_figure(6.4, "", width=9)
    axes = figure.subplot_mosaic([["poles", "heart"], ["force", "force"], ["error", "error"]])
    true_loop = loop_on(view.design, view.values.stiffness)
    draw_poles(axes["poles"], view.design)
    axes["poles"].plot(
        true_loop.poles.real,
        true_loop.poles.imag,
        "o",
        color=COLOURS["adaptive"],
        fillstyle="none",
        label="on true $K_s$",
    )
    draw_heart_sensitivity(axes["heart"], true_loop, view.values.stiffness)
    for variant in VARIANTS:
        run = view.trajectories[variant.name]
        force, desired = run["force"][:, 0], run["desired_force"][:, 0]
        line(axes["force"], run.time, force, variant.name, variant.title)
        line(axes["error"], run.time, 1e3 * (force - desired), variant.name, variant.title)
    dashed = {"linestyle": (0, (4, 2))}
    line(axes["force"], run.time, desired, "desired", "desired $F_d$", **dashed)
    axes["force"].set_ylabel(f"force {AXIS} (N)")
    axes["error"].set_ylabel("$y - F_d$ (mN)")
    axes["error"].set_xlabel("time (s)")
    axes["force"].sharex(axes["error"])
    legend_above(figure, [*_labelled(axes["poles"]), *axes["force"].get_lines()], columns=5)
    return figure


def _labelled(ax: Axes) -> list[Line2D]:
    return [each for each in ax.get_lines() if not str(each.get_label()).startswith("_")]


def _mean_pole(observer: Sequence[float]) -> float:
    """Geometric mean of the poles of a stable monic polynomial (rad/s)."""
    return float(observer[-1] ** (1 / (len(observer) - 1)))


def _with_values(values: DesignValues, scenario: Scenario) -> Scenario:
    observer = scenario.design.observer
    faster = values.observer_pole / _mean_pole(observer)
    return replace(
        scenario,
        stiffness=values.stiffness,
        design=replace(
            scenario.design,
            velocity_gain=values.velocity_gain,
            bandwidth=values.bandwidth,
            damping=values.damping,
            observer=tuple(value * faster**i for i, value in enumerate(observer)),
        ),
        adaptation=replace(scenario.adaptation, gain=values.adaptation_gain),
        simulation=replace(scenario.simulation, duration=DURATION),
    )


def _simulate(scenario: Scenario, design: RSTDesign) -> Mapping[str, Trajectory]:
    """Every variant on one axis; they share the compiled code and differ in parameters."""
    steps = [build_step(variant_controller(scenario, design, variant)) for variant in VARIANTS]
    loops = [
        build_axis_loop(
            step, velocity_gain=scenario.design.velocity_gain, stiffness=scenario.stiffness
        )
        for step in steps
    ]
    levels = scenario.reference.steps[-1].levels
    # The scenario's levels, closer together: its own instants lie beyond the short run.
    times = tuple(DURATION / 4 * k for k in range(len(levels)))
    inputs = axis_inputs(
        steps[0],
        heart=scenario_motion(scenario).displacement.selected([AXES.index(AXIS)]),
        reference=StepSequence(times=times, levels=levels).piecewise(DURATION),
        end=DURATION,
    )
    choice = scenario.simulation
    settings = RunSettings(duration=DURATION, step=choice.step, record_period=choice.record_period)
    engine = build_axis_engine(loops[0], inputs)
    return {
        variant.name: simulate_axis(loop, inputs=inputs, settings=settings, engine=engine)
        for variant, loop in zip(VARIANTS, loops, strict=True)
    }
