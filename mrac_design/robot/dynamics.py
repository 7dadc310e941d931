"""A robot's equations as CasADi functions with named inputs and outputs.

All functions are built of SX expressions, so that code generated from them is straight-line
arithmetic. Inertial parameters are an input of every function that needs them: the plant and
the controller's model are the same functions with different numbers. A function is derived when
it is first asked for, as no study needs them all, and kept for later processes.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from functools import cached_property, wraps
from typing import TYPE_CHECKING, Any

import casadi as ca

from mrac_design.derivation_cache import casadi_release, derived_text
from mrac_design.robot.description import RobotDescription

if TYPE_CHECKING:
    from mrac_design.robot.equations import Equations

_Outputs = Mapping[str, ca.SX]
_Derivation = Callable[["RobotDynamics", "Equations"], _Outputs]


def _function_of(needed: str) -> Callable[[_Derivation], cached_property[Any]]:
    """Make of named expressions the function of the `needed` symbols."""

    def decorate(derivation: _Derivation) -> cached_property[Any]:
        name = derivation.__name__

        @wraps(derivation)
        def function(self: RobotDynamics) -> ca.Function:
            def derive() -> str:
                own = self._equations
                return str(own.function(name, needed, derivation(self, own)).serialize())

            content = pickle.dumps((name, self.description))
            text = derived_text(("robot",), casadi_release(), content, derive)
            return ca.Function.deserialize(text)

        return cached_property(function)

    return decorate


class RobotDynamics:
    """Kinematics and rigid-body dynamics of one robot; n joints, m task components.

    Inputs: q (n,) rad or m, qd (n,), qdd (n,), torque (n,) joint efforts in N·m or N,
    parameters (p,) as `inertial_parameters` orders them. Friction and contact are not included.
    """

    description: RobotDescription
    """The robot these functions belong to."""

    def __init__(self, description: RobotDescription) -> None:
        self.description = description

    def __reduce__(self) -> tuple[Any, ...]:
        # Functions are derived again, or read, where they are needed.
        return RobotDynamics, (self.description,)

    @cached_property
    def _equations(self) -> Equations:
        # With all that derives them: not loaded where every function is kept.
        from mrac_design.robot.equations import Equations

        return Equations(self.description)

    @_function_of("q")
    def forward_kinematics(self, own: Equations) -> _Outputs:
        """(q) → rotation (3, 3) of the last frame, tip (3,) in m, tool_axis (3,); base frame."""
        tool = own.tool
        return {"rotation": tool.rotation, "tip": tool.tip, "tool_axis": tool.axis}

    @_function_of("q")
    def task_position(self, own: Equations) -> _Outputs:
        """(q) → position (m,): tip components in m, then tool-axis components."""
        return {"position": own.task_position}

    @_function_of("q")
    def task_jacobian(self, own: Equations) -> _Outputs:
        """(q) → jacobian J (m, n) of the task position."""
        return {"jacobian": own.task_jacobian}

    @_function_of("q")
    def jacobian(self, own: Equations) -> _Outputs:
        """(q) → jacobian (6, n), geometric, at the tool tip, linear part first; base frame."""
        return {"jacobian": own.jacobian}

    @_function_of("q qd")
    def task_bias_acceleration(self, own: Equations) -> _Outputs:
        """(q, qd) → bias J̇q̇ (m,) in m/s² and 1/s²."""
        return {"bias": own.task_bias}

    @_function_of("q qd acceleration")
    def joint_acceleration(self, own: Equations) -> _Outputs:
        """(q, qd, acceleration (m,)) → qdd = J⁻¹(ẍ − J̇q̇), (n,): the joints' part of exact
        linearisation [Z 2-4]."""
        return {"qdd": own.joint_acceleration}

    @_function_of("q parameters")
    def mass_matrix(self, own: Equations) -> _Outputs:
        """(q, parameters) → mass_matrix M (n, n), symmetric positive definite, drives included."""
        return {"mass_matrix": own.mass_matrix}

    @_function_of("q qd parameters")
    def velocity_torque(self, own: Equations) -> _Outputs:
        """(q, qd, parameters) → torque V = C q̇ (n,), Coriolis and centrifugal."""
        return {"torque": own.velocity_torque}

    @_function_of("q qd parameters")
    def coriolis_matrix(self, own: Equations) -> _Outputs:
        """(q, qd, parameters) → coriolis_matrix C (n, n) with Ṁ − 2C skew-symmetric."""
        return {"coriolis_matrix": own.coriolis_matrix}

    @_function_of("q parameters")
    def gravity_torque(self, own: Equations) -> _Outputs:
        """(q, parameters) → torque G (n,)."""
        return {"torque": own.gravity_torque}

    @_function_of("q qd parameters")
    def bias_torque(self, own: Equations) -> _Outputs:
        """(q, qd, parameters) → torque V + G (n,) in one pass, cheaper than the two apart."""
        return {"torque": own.bias_torque}

    @_function_of("q qd qdd parameters")
    def inverse_dynamics(self, own: Equations) -> _Outputs:
        """(q, qd, qdd, parameters) → torque M q̈ + V + G (n,) by recursive Newton-Euler."""
        return {"torque": own.inverse_dynamics}

    @_function_of("q qd torque parameters")
    def forward_dynamics(self, own: Equations) -> _Outputs:
        """(q, qd, torque, parameters) → qdd = M⁻¹(Γ − V − G), (n,), by L D Lᵀ."""
        return {"qdd": own.solution}

    @_function_of("q qd parameters")
    def energy(self, own: Equations) -> _Outputs:
        """(q, qd, parameters) → kinetic, potential (J, scalars)."""
        return {"kinetic": own.kinetic_energy, "potential": own.potential_energy}

    @_function_of("q qd torque parameters")
    def rigid_body_terms(self, own: Equations) -> _Outputs:
        """(q, qd, torque, parameters) → mass_matrix, bias_torque, task_jacobian,
        task_bias_acceleration, qdd: everything a simulation needs, sharing all it can."""
        return {
            "mass_matrix": own.mass_matrix,
            "bias_torque": own.bias_torque,
            "task_jacobian": own.task_jacobian,
            "task_bias_acceleration": own.shared_task_bias,
            "qdd": own.solution,
        }


def build_dynamics(description: RobotDescription) -> RobotDynamics:
    """The equations of a robot.

    Raises ParameterError when the joints cannot serve the task at any posture.
    """
    dynamics = RobotDynamics(description)
    _ = dynamics.joint_acceleration  # which tells whether they can
    return dynamics
