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
from mrac_design.controller.robot_step import saturated
from mrac_design.controller.step import ControllerStep, require_domain
from mrac_design.layout import Layout
from mrac_design.robot import RobotDynamics, check_posture, inertial_parameters
from mrac_design.simulation.contact import Contact, Touch
from mrac_design.simulation.friction import Friction
from mrac_design.simulation.system import ARGUMENT_NAMES, MODES, Event, HybridSystem, Kinks
from mrac_design.time_domain import Continuous


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
    kinks: Kinks = Kinks.LOCATED,
) -> ForceLoop:
    """Close the loop over the true `contact` with the true `friction` of the joints.

    Efforts are limited to the robot's own limits; events are the limits of the efforts and, where
    it can be lost, the contact. Raises ParameterError for a contact made for another number of
    axes, or controllers that are not continuous.
    """
    for controller in controllers:
        require_domain(controller, Continuous())
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
    equations = _Equations(plant, linearisation, tuple(controllers))
    system = _system(equations, kinks, state, inputs, parameters)
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
        made: ca.SX | None = None,
    ) -> tuple[ca.SX, ca.SX]:
        """Tip position (m) and contact force (N), (k,) each; `made` as `Touch` has it."""
        touch, tip = self._touch(states, exogenous, symbols, made)
        return tip, self.contact.force(touch)

    def contact_events(self) -> tuple[Event, ...]:
        """Contact made and lost on each axis; none where it is never lost."""
        axes = self.dynamics.description.force_axes
        if not self.contact.can_be_lost:
            return ()
        return tuple(Event(name=f"contact {a}", rising="made", falling="lost") for a in axes)

    def effort_events(self) -> tuple[Event, ...]:
        """The limit of each joint's effort, reached and left."""
        joints = self.dynamics.description.joints
        return tuple(
            Event(name=f"effort limit of {joint.name}", rising="left", falling="reached")
            for joint in joints
        )

    def contact_functions(
        self,
        states: Mapping[str, ca.SX],
        exogenous: Mapping[str, ca.SX],
        symbols: Mapping[str, ca.SX],
    ) -> ca.SX:
        """Event functions (N) of `contact_events`."""
        return self.contact.holds(self._touch(states, exogenous, symbols, None)[0])

    def _touch(
        self,
        states: Mapping[str, ca.SX],
        exogenous: Mapping[str, ca.SX],
        symbols: Mapping[str, ca.SX],
        made: ca.SX | None,
    ) -> tuple[Touch, ca.SX]:
        axes = len(self.dynamics.description.force_axes)
        q, qd = states["joint_position"], states["joint_velocity"]
        tip = self.dynamics.task_position(q)[:axes]
        touch = Touch(
            depth=tip - exogenous["heart"],
            velocity=self.dynamics.task_jacobian(q)[:axes, :] @ qd,
            inputs=exogenous,
            parameters=symbols,
            made=made,
        )
        return touch, tip

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


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """What moves and what is recorded, written in any symbols."""

    plant: Plant
    linearisation: Linearisation
    controllers: tuple[ControllerStep, ...]

    def written(
        self,
        states: Mapping[str, ca.SX],
        exogenous: Mapping[str, ca.SX],
        symbols: Mapping[str, ca.SX],
        modes: _Modes | None,
    ) -> _Written:
        """The equations with contact and limits in given modes, or as the state has them."""
        axes = self.plant.dynamics.description.force_axes
        q, qd = states["joint_position"], states["joint_velocity"]
        made = modes.made if modes is not None and self.plant.contact.can_be_lost else None
        tip, force = self.plant.contact_force(states, exogenous, symbols, made)
        commands, following, signals = [], [], []
        for i, (axis, step) in enumerate(zip(axes, self.controllers, strict=True)):
            own, reference = states[f"controller_{axis}"], exogenous["reference"][i]
            own_parameters = symbols[f"controller_{axis}"]
            command = step.command(own, force[i], reference, own_parameters)
            advanced, signal = step.advance(own, force[i], reference, command, own_parameters)
            commands.append(command)
            following.append(advanced)
            signals.append(step.signals.split(signal))
        command = ca.vertcat(*commands)
        wanted = self.linearisation.torque(q, qd, force, command, symbols["linearisation"])
        limit = symbols["effort_limit"]
        within = None if modes is None else modes.within
        effort = saturated(wanted, limit) if within is None else limited(wanted, limit, within)
        qdd = self.plant.acceleration(states, effort, force, symbols)
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
        return _Written(
            rate=ca.vertcat(qd, qdd, *following), margin=limit - ca.fabs(wanted), recorded=recorded
        )


def limited(wanted: ca.SX, limit: ca.SX, within: ca.SX) -> ca.SX:
    """`wanted` where it is taken to be within ± `limit` (1), else the limit with its sign (0).

    By factors and minima, entry by entry: branches would break the straight line of the program.
    """
    beyond = 1 + (1 - within) * _HUGE
    reach = limit + within * _HUGE
    return ca.fmax(ca.fmin(wanted * beyond, reach), -reach)


_HUGE = 1e30


@dataclass(frozen=True, slots=True, eq=False)
class _Modes:
    """Modes of the events as the rate goes by them."""

    made: ca.SX
    within: ca.SX


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Written:
    """Expressions of a loop."""

    rate: ca.SX
    margin: ca.SX
    recorded: Mapping[str, ca.SX]


def _system(
    equations: _Equations, kinks: Kinks, state: Layout, inputs: Layout, parameters: Layout
) -> HybridSystem:
    plant = equations.plant
    contact_events = plant.contact_events()
    events = (*contact_events, *plant.effort_events()) if kinks is Kinks.LOCATED else ()
    held = Layout(((MODES, len(events)),) if events else ())
    x, z = state.symbols("state"), held.symbols("held")
    v, p = inputs.symbols("input"), parameters.symbols("parameters")
    arguments = [x, z, v, p]
    variables = state.split(x), inputs.split(v), parameters.split(p)

    def function(name: str, result: ca.SX, label: str) -> ca.Function:
        return ca.Function(name, arguments, [result], list(ARGUMENT_NAMES), [label])

    plain = equations.written(*variables, None)
    moving, functions = plain, None
    if events:
        made, within = ca.vertsplit(z, [0, len(contact_events), len(events)])
        moving = equations.written(*variables, _Modes(made, within))
        functions = ca.vertcat(plant.contact_functions(*variables), moving.margin)
    outputs = Layout(tuple((name, value.numel()) for name, value in plain.recorded.items()))
    return HybridSystem(
        state=state,
        held=held,
        inputs=inputs,
        parameters=parameters,
        outputs=outputs,
        rate=function("rate", moving.rate, "rate"),
        output=function("output", outputs.join(plain.recorded), "output"),
        events=events,
        event_functions=None
        if functions is None
        else function("event_functions", functions, "events"),
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
