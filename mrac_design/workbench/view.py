"""What a design panel shows for one set of slider values: a pure function and its picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from mrac_design.design import RSTDesign
from mrac_design.metrics.tracking import TrackingMetrics, tracking_metrics
from mrac_design.motion import ForceReference
from mrac_design.report.figures_design import draw_heart_sensitivity, draw_poles
from mrac_design.report.style import CaptionedFigure, legend_above, line, new_figure, styled
from mrac_design.robot import (
    Body,
    Joint,
    JointType,
    RobotDescription,
    RobotDynamics,
    TaskDefinition,
    build_dynamics,
)
from mrac_design.simulation.scenario import Scenario
from mrac_design.simulation.trajectory import Trajectory
from mrac_design.study import VARIANTS, scenario_design, scenario_motion, simulate_variants

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
    """ao of the observer polynomial (rad/s)."""
    adaptation_gain: float
    """Scaled adaptation gain γ̂; 0 freezes the gains."""
    stiffness: float
    """True stiffness Ks of the tissue (N/m); the design keeps the scenario's."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignView:
    """Design and single-axis response for one set of values."""

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
        observer_pole=choice.observer_pole,
        adaptation_gain=scenario.adaptation.gain,
        stiffness=scenario.stiffness,
    )


def design_view(values: DesignValues, scenario: Scenario) -> DesignView:
    """Design for `values` and simulate one axis; everything else is the scenario's.

    The axis is a perfectly linearised mass sliding against the heart, run by the same simulation
    and the same controllers as the whole robot. Raises ParameterError for values that cannot be,
    SimulationError when the response grows without bound.
    """
    chosen = _single_axis(values, scenario)
    design = scenario_design(chosen)
    trajectories = simulate_variants(
        chosen, _sliding_mass(), design, scenario_motion(chosen), variants=VARIANTS
    )
    settling = chosen.simulation.settling
    return DesignView(
        design=design,
        trajectories=trajectories,
        tracking={
            name: tracking_metrics(run, settling=settling)[AXIS]
            for name, run in trajectories.items()
        },
    )


@styled()
def view_figure(view: DesignView) -> CaptionedFigure:
    """Poles, sensitivity to the heart's motion, force and force error in one picture."""
    figure = new_figure(6.4, "", width=9)
    axes = figure.subplot_mosaic([["poles", "heart"], ["force", "force"], ["error", "error"]])
    draw_poles(axes["poles"], view.design)
    draw_heart_sensitivity(axes["heart"], view.design)
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
    legend_above(figure, [*axes["poles"].get_lines()[:4], *axes["force"].get_lines()], columns=8)
    return figure


def _single_axis(values: DesignValues, scenario: Scenario) -> Scenario:
    steps = scenario.reference.steps[-1]
    # The scenario's levels, closer together: its own instants lie beyond the short run.
    times = tuple(DURATION / 4 * k for k in range(len(steps.times)))
    return replace(
        scenario,
        stiffness=values.stiffness,
        design=replace(
            scenario.design,
            velocity_gain=values.velocity_gain,
            bandwidth=values.bandwidth,
            damping=values.damping,
            observer_pole=values.observer_pole,
        ),
        adaptation=replace(scenario.adaptation, gain=values.adaptation_gain),
        reference=ForceReference(steps=(replace(steps, times=times),)),
        simulation=replace(scenario.simulation, duration=DURATION),
    )


@cache
def _sliding_mass() -> RobotDynamics:
    """A mass of 1 kg on a slide, without gravity: the simplest robot with one force axis."""
    slide = Joint(
        name="slide",
        type=JointType.PRISMATIC,
        alpha=0.0,
        d=0.0,
        theta=0.0,
        r=0.0,
        home=0.0,
        drive_inertia=0.0,
        coulomb_friction=0.0,
        viscous_friction=0.0,
        effort_limit=1e6,
        transmission=1.0,
    )
    body = Body(name="mass", mass=1.0, centre_of_mass=np.zeros(3), inertia=np.eye(3))
    return build_dynamics(
        RobotDescription(
            name="single axis",
            provenance="A unit mass; exact linearisation makes its size immaterial.",
            joints=(slide,),
            bodies=(body,),
            gravity=np.zeros(3),
            tool_tip=np.zeros(3),
            tool_axis=np.array([0.0, 0.0, 1.0]),
            task=TaskDefinition(position=(2,), tool_axis=()),
        )
    )
