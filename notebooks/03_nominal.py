# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3 (ipykernel)
#     language: python
#     name: python3
# ---

# %% [markdown]
# # The simulation
#
# Robot, linearisation and controller are now closed into one loop on the moving heart and run
# three times, with
#
# - the **frozen RST** controller, whose gains stay where the design put them,
# - the **adaptive** controller, the same with its gains moving as in [Z],
# - the **adaptive controller with the model's inverse** ahead of it,
#   $u_c = F_d + \frac{2\xi}{\omega}\dot F_d + \frac{1}{\omega^2}\ddot F_d$, whose derivatives are
#   the pre-filter's own states, so that the model's output is the desired force itself.

# %%
import os

import numpy as np
from IPython.display import Markdown, display

from mrac_design.report import (
    Table,
    comparison_table,
    compensation_figure,
    error_figure,
    force_figure,
    gains_figure,
    heart_motion_figure,
    scenario_provenance,
    torque_figure,
    torque_table,
    tracking_table,
)
from mrac_design.report.findings_paper import (
    adaptation_ratios,
    lag_percent,
    largest_percent,
)
from mrac_design.report.paper import paper_simulation
from mrac_design.report.tables_paper import largest_share
from mrac_design.robot import build_dynamics
from mrac_design.simulation.scenario import load_scenario
from mrac_design.study import run_study

scenario = load_scenario(os.environ.get("MRAC_SCENARIO", "nominal"))
study = run_study(scenario)
axes = study.robot.force_axes
simulation = paper_simulation(scenario)
engine = study.trajectories["frozen"].engine
repeated = (
    "[Z] has no simulation under these conditions."
    if simulation is None
    else f"These are the conditions of simulation {simulation.number} of [Z], "
    f"{simulation.condition}."
)
Markdown(
    f"**{scenario.title}.** {repeated} Each run lasts {scenario.simulation.duration:g} s, "
    f"integrated with steps of at most {1e6 * scenario.simulation.step:g} µs ({engine}). "
    f"The start, {scenario.simulation.settling:g} s, is left out of the figures of merit."
)

# %% [markdown]
# ## What goes in
#
# Neither the robot's parameters nor the heart recording nor the amplitudes of the force reference
# behind [Z] are public, so they had to be replaced. The table says of every quantity how far it
# can be trusted.

# %%
scenario_provenance(study)

# %% [markdown]
# ## The heart's motion

# %%
study.motion

# %%
heart_motion_figure(study)

# %% [markdown]
# ## Force on each axis
#
# Over the force, where the figures of [Z] end, all controllers look alike. The panels below it show
# the errors themselves.

# %%
force_figure(study, 0)

# %%
force_figure(study, 1)

# %%
if len(axes) > 2:
    display(force_figure(study, 2))

# %% [markdown]
# ## Compensation of the motion

# %%
compensation_figure(study)

# %% [markdown]
# ## Torques

# %%
torque_figure(study)

# %%
torque_table(study)

# %% [markdown]
# ## Adapted gains

# %%
gains_figure(study)

# %% [markdown]
# ## Errors, axis by axis

# %%
comparison_table(study)

# %%
error_figure(study)

# %%
tracking_table(study)


# %%
def over_axes(values, unit):
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return f"{low if low == high else f'{low} to {high}'} {unit}".rstrip()


still, plain, followed = (
    largest_percent(study, name) for name in ("frozen", "adaptive", "adaptive_inverse")
)
ratios, model_lag = adaptation_ratios(study), lag_percent(study)
share = "Most" if np.all(2 * np.array(model_lag) > plain) else "Part"
lagging = (
    f"{share} of the adaptive controller's error is not the heart's: the reference model lags "
    f"behind the desired force by up to {over_axes(model_lag, '%')} at the steps, and both "
    "controllers follow the model."
    if max(model_lag) > 0.05 * min(plain)
    else "The reference model's lag behind the desired force has hardly a part in either: it is at "
    f"most {max(model_lag):.2g} %."
)
gained = (
    "That gain shows in the force only when the lag is taken away: with the model's inverse the "
    "largest error is"
    if max(followed) < min(plain)
    else "Taking the lag away with the model's inverse does not help on every axis here: the "
    "largest error is then"
)
Markdown(
    f"""The adaptive controller keeps the force within **{over_axes(plain, "%")}** of the largest
desired force, axis by axis; the *same controller without any adaptation* within
{over_axes(still, "%")}. {lagging}

What adaptation does is seen in the error to the model's output $y_m$: its rms is
{over_axes(ratios, "")} times the frozen controller's. {gained} **{over_axes(followed, "%")}**."""
)

# %% [markdown]
# ## Claims, judged on this run
#
# Each line is computed from the trajectories above; a claim that this scenario does not meet says
# so.

# %%
use = max(largest_share(study, name) for name in study.trajectories)
claims = (
    ("controller of [Z]: largest force error", max(plain), 4.0, "%"),
    ("with the model's inverse: largest force error", max(followed), 0.3, "%"),
    ("adaptive over frozen: rms of $y - y_m$", max(ratios), 1 / 3, ""),
    ("largest torque over its limit", 100 * use, 100.0, "%"),
    (
        "condition number of the task Jacobian",
        study.worst_condition,
        scenario.simulation.condition_limit,
        "",
    ),
)
Table(
    caption="Claims made for the packaged nominal scenario, and what this run says; the worst axis "
    "or motor counts.",
    header=("claim", "this run", "limit", "met"),
    rows=tuple(
        (name, f"{value:.3g} {unit}", f"{limit:.3g} {unit}", "yes" if value <= limit else "**no**")
        for name, value, limit, unit in claims
    ),
    numeric=(1, 2),
)

# %% [markdown]
# ## Checks of what this chapter says
#
# The figures of merit are computed once more, straight from the forces, and the forces from the
# tissue's law. For the packaged nominal scenario every claim above has to be met.

# %%
contact, recorded = scenario.contact, scenario.simulation.record_period
schedule = contact.stiffness_factor
# Where the tissue or its surface jumps, a sample may show either side.
jumps = np.array([*schedule.times[1:], *contact.retreat.times[1:], np.inf])
tip_jacobian = build_dynamics(study.robot).task_jacobian.map(study.trajectories["frozen"].time.size)


def tissue_force(trajectory):
    """Force (N) that the tissue holds against the recorded tip."""
    time, depth = trajectory.time, trajectory["tip"] - trajectory["heart"]
    J = np.array(tip_jacobian(trajectory["joint_position"].T))
    J = J.reshape(J.shape[0], time.size, -1)[: len(axes)]
    tip_velocity = np.einsum("atj,tj->ta", J, trajectory["joint_velocity"])
    heart_velocity = study.motion.displacement.derivative()(time)[list(study.robot.task.position)]
    rate = tip_velocity - heart_velocity.T
    factor = np.array(schedule.levels)[np.searchsorted(schedule.times, time, side="right") - 1]
    force = factor[:, None] * (scenario.stiffness * depth + contact.damping * rate)
    return force if contact.kind == "two_sided" else np.where(depth > 0, np.maximum(force, 0), 0)


for name, trajectory in study.trajectories.items():
    kept = trajectory.time >= scenario.simulation.settling
    error = trajectory["force"] - trajectory["desired_force"]
    percent = (
        100 * np.abs(error[kept]).max(axis=0) / np.abs(trajectory["desired_force"]).max(axis=0)
    )
    reported = [study.tracking[name][axis].max_force_error_percent for axis in axes]
    assert np.allclose(percent, reported, rtol=1e-9)  # the same numbers, summed in another order
    # The tissue carries the force: positions, velocities and forces were recorded separately.
    carried = tissue_force(trajectory)
    away = np.min(np.abs(trajectory.time[:, None] - jumps), axis=1) > recorded
    assert np.allclose(carried[away], trajectory["force"][away], atol=1e-9)
gains = study.trajectories["frozen"]["adapted_gains"]
assert np.ptp(gains, axis=0).max() == 0  # frozen means frozen
if scenario == load_scenario("nominal"):
    assert all(value <= limit for _, value, limit, _ in claims)
Markdown("All checks passed.")
