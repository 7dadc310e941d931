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
# # The robot and its exact linearisation
#
# The robot holds a tool against the beating heart. In contact its equations are
#
# $$\Gamma = M(q)\,\ddot q + V(q,\dot q) + G(q) + J^{\mathsf T}(q)\,F_e ,$$
#
# with the joint efforts $\Gamma$ and the contact force $F_e$ that a sensor at the tool measures
# [Z 1]. Seen at the tool, with task coordinates $X$,
#
# $$M_x\ddot X + V_x + G_x = F_{sc} - F_e,\qquad M_x = J^{-\mathsf T} M J^{-1},\quad
#   V_x = J^{-\mathsf T} V - M_x\dot J\dot q,\quad G_x = J^{-\mathsf T} G \qquad \text{[Z 2]}.$$
#
# Sources are quoted as **[Z]**: Zarrouk, Chemori and Poignet, *Adaptive Force Feedback Control for
# 3D Compensation of Physiological Motion in Beating Heart Surgery*, IROS 2010, and **[AW]**: Åström
# and Wittenmark, *Adaptive Control*, 2nd edition. Numbers in brackets are equations there.

# %%
import os

import numpy as np
from IPython.display import Markdown

from mrac_design.controller.linearisation import RobotModelError, build_linearisation
from mrac_design.report import Table, posture_figure
from mrac_design.robot import build_dynamics, build_task_space, inertial_parameters, load_robot
from mrac_design.robot.posture import condition_numbers
from mrac_design.simulation.scenario import load_scenario

scenario = load_scenario(os.environ.get("MRAC_SCENARIO", "nominal"))
robot = load_robot(scenario.robot)
dynamics = build_dynamics(robot)
task_space = build_task_space(dynamics)
parameters = inertial_parameters(robot)

# %% [markdown]
# ## What is known and what is assumed
#
# The D2M2's parameters were never published. All numbers below are those of a **stand-in**: a robot
# with the same number of joints and physically consistent masses and inertias, assumed, not
# identified.

# %%
robot

# %%
posture_figure(robot)

# %% [markdown]
# ## At the home posture


# %%
def numbers(values):
    # Anything below rounding of the largest entry is zero.
    values = np.where(np.abs(values) > 1e-12 * np.max(np.abs(values)), values, 0.0)
    return ", ".join(f"{value:.4g}" for value in np.ravel(values))


home = robot.home
tip = dynamics.forward_kinematics(home)[1].full().ravel()
mass_matrix = dynamics.mass_matrix(home, parameters).full()
gravity = dynamics.gravity_torque(home, parameters).full().ravel()
home_condition = condition_numbers(dynamics, [home])[0]
Table(
    caption="Derived from the description at the home posture.",
    header=("quantity", "value"),
    rows=(
        ("tool tip (m)", numbers(tip)),
        ("diagonal of $M$ (kg or kg·m²)", numbers(np.diag(mass_matrix))),
        ("smallest eigenvalue of $M$", numbers(np.linalg.eigvalsh(mass_matrix)[0])),
        ("efforts $G$ against gravity (N or N·m)", numbers(gravity)),
        ("largest efforts of the drives (N or N·m)", numbers(robot.effort_limits)),
        (
            "drives hold the robot's weight",
            "yes" if np.all(np.abs(gravity) < robot.effort_limits) else "**no**",
        ),
        ("condition number of the task Jacobian $J$", numbers(home_condition)),
    ),
)

# %% [markdown]
# ## Exact linearisation
#
# With the model's own terms and the measured force,
#
# $$F_{sc} = M_x f^* + V_x + G_x + F_e,\qquad \Gamma = J^{\mathsf T} F_{sc}
#   \quad\Rightarrow\quad \ddot X = f^* \qquad \text{[Z 3, 4]},$$
#
# on the force axes with $f^* = u - K_2\dot X$. When the model is right the robot's dynamics
# cancel. Drawn at random around the home posture, postures, velocities, forces and commands give
# the difference $\ddot X - f^*$ that remains; beside it what remains when the controller's model
# is wrong, its bodies by 5 % and the first joint's row by 25 %.

# %%
force_count = len(robot.force_axes)
generator = np.random.default_rng(1)
trials = [
    {
        "q": home + 0.05 * generator.uniform(-1, 1, robot.joint_count),
        "qd": generator.uniform(-1, 1, robot.joint_count),
        "force": generator.uniform(-2, 2, force_count),
        "command": generator.uniform(-5, 5, force_count),
    }
    for _ in range(100)
]


def remainder(model_error):
    """Largest |Ẍ − f*| on the force axes over all trials (m/s²)."""
    K2 = scenario.design.velocity_gain
    linearisation = build_linearisation(
        dynamics,
        velocity_gain=K2,
        tool_axis_bandwidth=scenario.design.tool_axis_bandwidth,
        model_error=model_error,
    )
    worst = 0.0
    for trial in trials:
        q, qd, force, command = trial.values()
        effort = linearisation.torque(q, qd, force, command, linearisation.parameter_values)
        J = dynamics.task_jacobian(q).full()
        free = effort.full().ravel() - J[:force_count].T @ force
        qdd = dynamics.forward_dynamics(q, qd, free, parameters).full().ravel()
        acceleration = J @ qdd + dynamics.task_bias_acceleration(q, qd).full().ravel()
        wanted = command - K2 * (J @ qd)[:force_count]
        worst = max(worst, np.abs(acceleration[:force_count] - wanted).max())
    return worst


perfect = remainder(RobotModelError(body_scale=1.0, first_joint_scale=1.0))
wrong = remainder(RobotModelError(body_scale=1.05, first_joint_scale=1.25))
worst_condition = condition_numbers(dynamics, [trial["q"] for trial in trials]).max()
Markdown(
    f"Over {len(trials)} trials the largest remainder is **{perfect:.1e} m/s²** with the perfect "
    f"model, which is rounding, and {wrong:.3g} m/s² with the wrong one. The condition number of "
    f"$J$ stayed below {worst_condition:.3g}; the scenario refuses to start above "
    f"{scenario.simulation.condition_limit:g}, where $J^{{-1}}$ would magnify every error."
)

# %% [markdown]
# The task-space inertia $M_x$ at home says how heavy the robot feels at the tool, axis by axis.

# %%
apparent = np.diag(task_space.Mx(home, parameters).full())[:force_count]
Table(
    caption="Apparent mass at the tool, the diagonal of $M_x$ at home, derived.",
    header=("axis", "apparent mass (kg)"),
    rows=tuple((name, f"{m:.3g}") for name, m in zip(robot.force_axes, apparent, strict=True)),
    numeric=(1,),
)

# %% [markdown]
# ## Checks of what this chapter says
#
# The mass matrix is symmetric and positive definite, the remainder of the linearisation is
# rounding, and the home posture is regular.

# %%
assert np.allclose(mass_matrix, mass_matrix.T)
assert np.linalg.eigvalsh(mass_matrix)[0] > 0
assert perfect < 1e-9  # m/s²; the commands are of order one
assert wrong > 1e6 * perfect
assert home_condition < scenario.simulation.condition_limit
Markdown("All checks passed.")
