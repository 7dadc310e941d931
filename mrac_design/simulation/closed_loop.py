"""The robot on the heart under force control, as one hybrid system.

reference ─► axis controllers ─u─► linearisation ─Γ─► robot ─X─► tissue ─Fe─┐
                   ▲                    ▲                          ▲        │
                   └────────────────────┴───── Fe ─────────────── X − Xh ◄──┘
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.linearisation import Linearisation
from mrac_design.controller.robot_step import within_limits
from mrac_design.controller.step import ControllerStep
from mrac_design.layout import Layout
from mrac_design.robot import RobotDynamics, check_posture, inertial_parameters
from mrac_design.simulation.contact import Contact, Touch
from mrac_design.simulation.friction import Friction
from mrac_design.simulation.system import ARGUMENT_NAMES, HybridSystem


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ForceLoop:
    """A closed loop ready to run, and what is needed to start it and to read its outputs."""

    system: HybridSystem
    """The equations; inputs are heart position (m) and force reference (N), k of each."""
    parameter_values: FloatArray
    """Values of the system's parameters."""
    dynamics: RobotDynamics
    """The true robot."""
    controllers: tuple[ControllerStep, ...]
    """One controller a force axis."""


def build_force_loop(
    dynamics: RobotDynamics,
    linearisation: Linearisation,
    controllers: Sequence[ControllerStep],
    *,
    contact: Contact,
    friction: Friction,
) -> ForceLoop:
    """Close the loop over the true `contact` with the true `friction` of the joints.

    Efforts are limited to the robot's own limits. Raises ParameterError for a contact made for
    another number of axes.
    """
    robot = dynamics.description
    axes, n = robot.force_axes, robot.joint_count
    values = {
        "inertia": inertial_parameters(robot),
        "effort_limit": robot.effort_limits,
        **contact.values(len(axes)),
        **friction.values(robot),
        "linearisation": linearisation.parameter_values,
        **{f"controller_{a}": c.parameter_values for a, c in zip(axes, controllers, strict=True)},
    }
    parameters = Layout(tuple((name, np.size(value)) for name, value in values.items()))
    state = Layout(
        (
            ("joint_position", n),
            ("joint_velocity", n),
            *((f"controller_{a}", c.state.size) for a, c in zip(axes, controllers, strict=True)),
        )
    )
    inputs = Layout(
        (("heart", len(axes)), ("reference", len(axes)), *contact.inputs(len(axes)).blocks)
    )
    plant = Plant(dynamics=dynamics, contact=contact, friction=friction)
    system = _system(plant, linearisation, controllers, state, inputs, parameters)
    return ForceLoop(
        system=system,
        parameter_values=parameters.pack(values),
        dynamics=dynamics,
        controllers=tuple(controllers),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plant:
    """What a controller acts on: the true robot, its joints' friction and the tissue."""

    dynamics: RobotDynamics
    """The true robot."""
    contact: Contact
    """What the tissue does."""
    friction: Friction
    """What the joints lose."""

    def contact_force(
        self,
        states: Mapping[str, ca.SX],
        exogenous: Mapping[str, ca.SX],
        symbols: Mapping[str, ca.SX],
    ) -> tuple[ca.SX, ca.SX]:
        """Tip position (m) and contact force (N), (k,) each."""
        axes = len(self.dynamics.description.force_axes)
        q, qd = states["joint_position"], states["joint_velocity"]
        tip = self.dynamics.task_position(q)[:axes]
        touch = Touch(
            depth=tip - exogenous["heart"],
            velocity=self.dynamics.task_jacobian(q)[:axes, :] @ qd,
            inputs=exogenous,
            parameters=symbols,
        )
        return tip, self.contact.force(touch)

    def acceleration(
        self,
        states: Mapping[str, ca.SX],
        effort: ca.SX,
        force: ca.SX,
        symbols: Mapping[str, ca.SX],
    ) -> ca.SX:
        """Joint accelerations (n,) under joint efforts and the contact force (N) on the tip."""
        q, qd = states["joint_position"], states["joint_velocity"]
        left = self.friction.remaining(effort, qd, symbols)
        return contact_acceleration(self.dynamics, q, qd, left, force, symbols["inertia"])


def _system(
    plant: Plant,
    linearisation: Linearisation,
    controllers: Sequence[ControllerStep],
    state: Layout,
    inputs: Layout,
    parameters: Layout,
) -> HybridSystem:
    axes = plant.dynamics.description.force_axes
    held = Layout(())
    x, z = state.symbols("state"), held.symbols("held")
    v, p = inputs.symbols("input"), parameters.symbols("parameters")
    states, exogenous, symbols = state.split(x), inputs.split(v), parameters.split(p)
    q, qd = states["joint_position"], states["joint_velocity"]

    tip, force = plant.contact_force(states, exogenous, symbols)
    commands, following, signals = [], [], []
    for i, (axis, step) in enumerate(zip(axes, controllers, strict=True)):
        own, reference = states[f"controller_{axis}"], exogenous["reference"][i]
        own_parameters = symbols[f"controller_{axis}"]
        command = step.command(own, force[i], reference, own_parameters)
        advanced, signal = step.advance(own, force[i], reference, command, own_parameters)
        commands.append(command)
        following.append(advanced)
        signals.append(step.signals.split(signal))
    command = ca.vertcat(*commands)
    wanted = linearisation.torque(q, qd, force, command, symbols["linearisation"])
    still = linearisation.torque(q, qd, force, ca.DM.zeros(len(axes)), symbols["linearisation"])
    effort = within_limits(wanted, wanted - still, symbols["effort_limit"])
    qdd = plant.acceleration(states, effort, force, symbols)
    rate = ca.vertcat(qd, qdd, *following)

    recorded = {
        "force": force,
        "force_reference": exogenous["reference"],
        "tip": tip,
        "heart": exogenous["heart"],
        "effort": effort,
        "joint_position": q,
        "joint_velocity": qd,
        "command": command,
        **{name: ca.vertcat(*(s[name] for s in signals)) for name in signals[0]},
    }
    outputs = Layout(tuple((name, value.numel()) for name, value in recorded.items()))
    arguments = [x, z, v, p]
    return HybridSystem(
        state=state,
        held=held,
        inputs=inputs,
        parameters=parameters,
        outputs=outputs,
        rate=ca.Function("rate", arguments, [rate], list(ARGUMENT_NAMES), ["rate"]),
        output=ca.Function(
            "output", arguments, [outputs.join(recorded)], list(ARGUMENT_NAMES), ["output"]
        ),
    )


def contact_acceleration(
    dynamics: RobotDynamics, q: ca.SX, qd: ca.SX, effort: ca.SX, force: ca.SX, inertia: ca.SX
) -> ca.SX:
    """Joint accelerations (n,) under joint efforts and the contact force (N) on the tip [Z 1]."""
    J = dynamics.task_jacobian(q)
    contact = J[: len(dynamics.description.force_axes), :].T @ force
    return dynamics.forward_dynamics(q, qd, effort - contact, inertia)


def resting_state(
    loop: ForceLoop, *, posture: ArrayLike, force: ArrayLike, condition_limit: float
) -> FloatArray:
    """The loop at rest at a posture, every controller settled on its force (N, k values).

    Raises SingularPostureError when the task Jacobian's condition number there exceeds
    `condition_limit`.
    """
    check_posture(loop.dynamics, posture, condition_limit)
    axes = loop.dynamics.description.force_axes
    n = loop.dynamics.description.joint_count
    settled = {
        f"controller_{axis}": step.equilibrium(float(level), step.parameter_values).full().ravel()
        for axis, step, level in zip(axes, loop.controllers, np.ravel(force), strict=True)
    }
    return readonly(
        loop.system.state.pack(
            {"joint_position": posture, "joint_velocity": np.zeros(n), **settled}
        )
    )
