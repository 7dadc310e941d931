r"""The whole robot controller as one sampled step: every force axis and the linearising torque.

    force ─┬─► axis controllers ─u─► linearisation ─Γ─► effort limits ─Γ̄─► robot
           │        ▲                                        │
           │        └────────── u + J M̂⁻¹ (Γ̄ − Γ) ◄──────────┘   [force axes]

Where a joint saturates, the acceleration the robot is really given differs from the command by
J M̂⁻¹ (Γ̄ − Γ); the filters and η of the adaptive law are fed that *applied* command, so that
saturation is not mistaken for an error of the gains. Where none does, Γ̄ − Γ is exactly zero and
the applied command is the command itself, bit for bit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from mrac_design.arrays import FloatArray, readonly
from mrac_design.controller.linearisation import Linearisation
from mrac_design.controller.portable_math import with_portable_trigonometry
from mrac_design.controller.step import ControllerStep, require_domain
from mrac_design.errors import ParameterError
from mrac_design.layout import Layout
from mrac_design.robot import RobotDescription, RobotDynamics
from mrac_design.robot.linear_algebra import solve_symmetric
from mrac_design.time_domain import Continuous, Discrete

STEP_INPUTS = ("state", "q", "qd", "force", "reference", "parameters")
"""Names of the inputs of `RobotStep.step`, in order."""
STEP_OUTPUTS = ("next_state", "torque", "signals")
"""Names of the outputs of `RobotStep.step`, in order."""

_NOTHING = 1e-30
"""Lost beside any effort (N·m or N), and not 0 even in single precision."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RobotStep:
    """A sampled controller of all n joints with k force axes; it is what the robot runs.

    The same expressions are simulated and exported; they hold no sine or cosine of a C library.
    """

    robot: RobotDescription
    """The robot it is made for."""
    time_domain: Discrete
    """Its sampling period."""
    controllers: tuple[ControllerStep, ...]
    """The controllers it joins, one a force axis."""
    state: Layout
    """Entries of the state: those of each axis under `X_`, `Y_`, …"""
    parameters: Layout
    """Entries of the parameters: linearisation, `effort_limit`, each axis under `X_`, `Y_`, …"""
    signals: Layout
    """Entries of the signals: `command` (computed), `applied_command` and the controllers' own."""
    parameter_values: FloatArray
    """Parameters as designed, shape (parameters.size,)."""
    step: ca.Function
    """(state, q (n,), qd (n,), force N (k,), reference N (k,), parameters) → next_state,
    torque (n,) joint efforts within their limits in N·m or N, signals."""
    equilibrium: ca.Function
    """(force N (k,), parameters) → state at rest at that force and reference."""

    def resting_state(self, force: Sequence[float] | FloatArray) -> FloatArray:
        """State at rest at `force` (N, k values), with the parameters as designed."""
        return readonly(self.equilibrium(force, self.parameter_values).full().ravel())


def build_robot_step(
    dynamics: RobotDynamics,
    linearisation: Linearisation,
    controllers: Sequence[ControllerStep],
    *,
    time_domain: Discrete,
) -> RobotStep:
    """Join one controller a force axis, in the order of the task, with the linearising torque.

    `controllers` were built for `time_domain`. Raises ParameterError when their number is not
    the number of force axes, or one of them is continuous, of another period or needs events.
    """
    robot = dynamics.description
    axes, n = robot.force_axes, robot.joint_count
    if len(controllers) != len(axes):
        raise ParameterError(
            "controllers", len(controllers), f"needs one per force axis: {', '.join(axes)}"
        )
    for axis, controller in zip(axes, controllers, strict=True):
        _require_sampled(axis, controller, time_domain)
    values: dict[str, FloatArray] = {
        **_blocks(linearisation.parameters, linearisation.parameter_values),
        "effort_limit": readonly(robot.effort_limits),
    }
    for axis, controller in zip(axes, controllers, strict=True):
        values |= _blocks(controller.parameters.prefixed(f"{axis}_"), controller.parameter_values)
    parameters = Layout(tuple((name, value.size) for name, value in values.items()))
    state = _joined_by_axis(axes, [controller.state for controller in controllers])
    x, p = state.symbols("state"), parameters.symbols("parameters")
    inputs = [
        x,
        *(ca.SX.sym(name, n) for name in ("q", "qd")),
        *(ca.SX.sym(name, len(axes)) for name in ("force", "reference")),
        p,
    ]
    outputs, signals = _step_outputs(
        dynamics, linearisation, controllers, (state, parameters), inputs
    )
    raw = ca.Function("robot_step", inputs, outputs, list(STEP_INPUTS), list(STEP_OUTPUTS))
    return RobotStep(
        robot=robot,
        time_domain=time_domain,
        controllers=tuple(controllers),
        state=state,
        parameters=parameters,
        signals=signals,
        parameter_values=parameters.pack(values),
        step=_shared(with_portable_trigonometry(raw)),
        equilibrium=_equilibrium(axes, controllers, parameters, p),
    )


def _step_outputs(
    dynamics: RobotDynamics,
    linearisation: Linearisation,
    controllers: Sequence[ControllerStep],
    layouts: tuple[Layout, Layout],
    inputs: Sequence[ca.SX],
) -> tuple[list[ca.SX], Layout]:
    axes = dynamics.description.force_axes
    x, q, qd, force, reference, p = inputs
    states, symbols = layouts[0].split(x), layouts[1].split(p)
    own = [
        (
            _gathered(states, controller.state, axis),
            force[i],
            reference[i],
            _gathered(symbols, controller.parameters, axis),
        )
        for i, (axis, controller) in enumerate(zip(axes, controllers, strict=True))
    ]
    command = ca.vertcat(
        *(controller.command(*part) for controller, part in zip(controllers, own, strict=True))
    )
    model = linearisation.parameters.join(
        {name: symbols[name] for name, _ in linearisation.parameters.blocks}
    )
    wanted = linearisation.torque(q, qd, force, command, model)
    held = linearisation.torque(q, qd, force, ca.DM.zeros(len(axes)), model)
    torque = within_limits(wanted, wanted - held, symbols["effort_limit"])
    applied = command + _lost_acceleration(dynamics, q, torque - wanted, symbols)
    advanced = [
        controller.advance(*part[:3], applied[i], part[3])
        for i, (controller, part) in enumerate(zip(controllers, own, strict=True))
    ]
    parts = [
        controller.signals.split(signal)
        for controller, (_, signal) in zip(controllers, advanced, strict=True)
    ]
    reported = {
        "command": command,
        "applied_command": applied,
        **{name: ca.vertcat(*(part[name] for part in parts)) for name in parts[0]},
    }
    signals = Layout(tuple((name, value.numel()) for name, value in reported.items()))
    following = ca.vertcat(*(state for state, _ in advanced))
    return [following, torque, signals.join(reported)], signals


def within_limits(wanted: ca.SX, commanded: ca.SX, limit: ca.SX) -> ca.SX:
    """Efforts within ± `limit`: of the part that the force command adds, as much as there is room.

    The command shrinks as a whole and keeps its direction; clipping joint by joint would turn it,
    and through the Jacobian push an axis that asked for nothing. What is out of its limits
    without any command is clipped. All in N·m or N.
    """
    # Which share of the command is too much, at most 1, and none where it pushes inwards.
    excess = _positive_part(ca.fabs(wanted) - limit)
    share = excess / (ca.fmax(ca.fabs(commanded), excess) + _NOTHING)
    cut = ca.mmax(share * outwards(wanted, commanded))
    return saturated(wanted - cut * commanded, limit)


def outwards(wanted: ca.SX, commanded: ca.SX) -> ca.SX:
    """1 where the commanded part makes the whole effort larger, else 0, entry by entry."""
    along = wanted * commanded
    return _positive_part(along) / (ca.fabs(along) + _NOTHING)


def _positive_part(x: ca.SX) -> ca.SX:
    """max(x, 0) without a comparison, of which compilers make branches: a step is to take the
    same time on all data."""
    return (x + ca.fabs(x)) / 2


def saturated(wanted: ca.SX, limit: ca.SX) -> ca.SX:
    """Efforts within ± `limit`, entry by entry, same units."""
    return ca.fmax(ca.fmin(wanted, limit), -limit)


def _lost_acceleration(
    dynamics: RobotDynamics, q: ca.SX, missing: ca.SX, symbols: Mapping[str, ca.SX]
) -> ca.SX:
    """J M̂⁻¹ (Γ̄ − Γ) on the force axes (m/s²); exactly zero when nothing is missing."""
    axes = len(dynamics.description.force_axes)
    mass = dynamics.mass_matrix(q, symbols["inertia"])
    # The controller's model scales the first joint's whole row, M̂ = diag(scale) M.
    joint = solve_symmetric(mass, missing / symbols["torque_scale"])
    return dynamics.task_jacobian(q)[:axes, :] @ joint


def _require_sampled(axis: str, controller: ControllerStep, domain: Discrete) -> None:
    if controller.events.size:
        raise ParameterError(
            "controllers",
            f"axis {axis}",
            "measures more than force and joints; the robot's step has no input for its events",
        )
    if isinstance(controller.time_domain, Continuous):
        raise ParameterError(
            "controllers", f"axis {axis}", "is continuous; build it with Discrete(period)"
        )
    require_domain(controller, domain)


def _equilibrium(
    axes: Sequence[str], controllers: Sequence[ControllerStep], parameters: Layout, p: ca.SX
) -> ca.Function:
    force = ca.SX.sym("force", len(axes))
    symbols = parameters.split(p)
    settled = [
        controller.equilibrium(force[i], _gathered(symbols, controller.parameters, axis))
        for i, (axis, controller) in enumerate(zip(axes, controllers, strict=True))
    ]
    raw = ca.Function(
        "robot_equilibrium",
        [force, p],
        [ca.densify(ca.vertcat(*settled))],
        ["force", "parameters"],
        ["state"],
    )
    return _shared(raw)


def _shared(function: ca.Function) -> ca.Function:
    """The function with common subexpressions computed once."""
    arguments = function.sx_in()
    outputs = ca.cse(list(function.call(arguments)))
    return ca.Function(function.name(), arguments, outputs, function.name_in(), function.name_out())


def _blocks(layout: Layout, values: FloatArray) -> dict[str, FloatArray]:
    return {name: readonly(part) for name, part in layout.split(np.asarray(values)).items()}


def _gathered(blocks: Mapping[str, ca.SX], layout: Layout, axis: str) -> ca.SX:
    return ca.vertcat(*(blocks[f"{axis}_{name}"] for name, _ in layout.blocks))


def _joined_by_axis(axes: Sequence[str], layouts: Sequence[Layout]) -> Layout:
    prefixed = (layout.prefixed(f"{axis}_") for axis, layout in zip(axes, layouts, strict=True))
    return Layout(tuple(block for layout in prefixed for block in layout.blocks))
