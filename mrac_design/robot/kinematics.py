"""Frames, velocities and accelerations of a serial chain, in symbols.

Vectors are (3, 1) CasADi columns. Constants that are zero stay zero through every product, so
the expressions hold only what the robot's own geometry needs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from mrac_design.robot.description import RobotDescription
from mrac_design.robot.parts import Joint, JointType

_SNAP = 1e-15
"""Cosines and sines of constant angles this close to −1, 0, 1 are those numbers: a file holds
π/2 in 17 digits, and 6e-17 would keep whole branches of the expressions alive."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointTransform:
    """Pose of link frame j in frame j−1, kept as the two rotations it consists of."""

    cos_alpha: float
    """cos α (–)."""
    sin_alpha: float
    """sin α (–)."""
    cos_theta: ca.SX
    """cos θ (–)."""
    sin_theta: ca.SX
    """sin θ (–)."""
    translation: ca.SX
    """Origin of frame j in frame j−1 (m), shape (3, 1)."""
    prismatic: bool
    """Whether the joint slides along z instead of turning about it."""

    def to_parent(self, vector: ca.SX) -> ca.SX:
        """Components in frame j−1 of a vector given in frame j."""
        x, y, z = ca.vertsplit(vector)
        c, s, ca_, sa = self.cos_theta, self.sin_theta, self.cos_alpha, self.sin_alpha
        turned = s * x + c * y
        return ca.vertcat(c * x - s * y, ca_ * turned - sa * z, sa * turned + ca_ * z)

    def to_child(self, vector: ca.SX) -> ca.SX:
        """Components in frame j of a vector given in frame j−1."""
        x, y, z = ca.vertsplit(vector)
        c, s, ca_, sa = self.cos_theta, self.sin_theta, self.cos_alpha, self.sin_alpha
        turned = ca_ * y + sa * z
        return ca.vertcat(c * x + s * turned, c * turned - s * x, ca_ * z - sa * y)

    def tensor_to_parent(self, tensor: ca.SX) -> ca.SX:
        """Components in frame j−1 of a symmetric tensor given in frame j, shape (3, 3)."""
        about_z = _rotate_tensor(tensor, self.cos_theta, self.sin_theta, (0, 1, 2))
        return _rotate_tensor(about_z, self.cos_alpha, self.sin_alpha, (1, 2, 0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinkMotion:
    """Motion of a link frame, in that frame's own components."""

    angular_velocity: ca.SX
    """ω (rad/s), shape (3, 1)."""
    angular_acceleration: ca.SX
    """ω̇ (rad/s²), shape (3, 1)."""
    acceleration: ca.SX
    """Acceleration of the frame's origin (m/s²), shape (3, 1); gravity may be included."""

    def acceleration_matrix(self) -> ca.SX:
        """U = [ω̇]× + [ω]×[ω]×: a point at p fixed in the link has acceleration a + U p."""
        x, y, z = ca.vertsplit(self.angular_velocity)
        ax, ay, az = ca.vertsplit(self.angular_acceleration)
        return ca.blockcat(
            [
                [-(y * y + z * z), x * y - az, x * z + ay],
                [x * y + az, -(x * x + z * z), y * z - ax],
                [x * z - ay, y * z + ax, -(x * x + y * y)],
            ]
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ToolKinematics:
    """Where the tool is and how the joints move it, in the base frame."""

    rotation: ca.SX
    """Orientation of the last link frame in the base frame, shape (3, 3)."""
    tip: ca.SX
    """Tool tip (m), shape (3, 1)."""
    axis: ca.SX
    """Unit vector along the tool (–), shape (3, 1)."""
    linear_jacobian: ca.SX
    """∂(tip velocity)/∂q̇, shape (3, n)."""
    angular_jacobian: ca.SX
    """∂(angular velocity of the tool)/∂q̇, shape (3, n)."""
    axis_jacobian: ca.SX
    """∂(rate of the tool axis)/∂q̇, shape (3, n)."""
    origin_jacobian: ca.SX
    """∂(velocity of the last link frame's origin)/∂q̇, shape (3, n)."""


def joint_transforms(description: RobotDescription, q: ca.SX) -> tuple[JointTransform, ...]:
    """Transforms from each link frame to the one before, length n; q has shape (n, 1)."""
    return tuple(
        _transform(joint, variable)
        for joint, variable in zip(description.joints, ca.vertsplit(q), strict=True)
    )


def link_motions(
    transforms: tuple[JointTransform, ...], qd: ca.SX, qdd: ca.SX, base_acceleration: ArrayLike
) -> tuple[LinkMotion, ...]:
    """Outward recursion of velocities and accelerations, base to tool, length n.

    `base_acceleration` is −g to carry gravity along (Luh, Walker, Paul 1980), 0 for motion only.
    """
    still = ca.SX([0.0, 0.0, 0.0])
    link = LinkMotion(
        angular_velocity=still,
        angular_acceleration=still,
        acceleration=ca.SX(np.asarray(base_acceleration, dtype=np.float64)),
    )
    links = []
    for transform, rate, change in zip(
        transforms, ca.vertsplit(qd), ca.vertsplit(qdd), strict=True
    ):
        link = _next_motion(link, transform, rate, change)
        links.append(link)
    return tuple(links)


def tool_kinematics(
    description: RobotDescription, transforms: tuple[JointTransform, ...]
) -> ToolKinematics:
    """Pose and geometric Jacobians of the tool."""
    rotations, relative = _base_frames(transforms)
    last = rotations[-1]
    arm = last @ ca.SX(description.tool_tip)
    axis = last @ ca.SX(description.tool_axis)
    linear, angular, turning, origin = [], [], [], []
    for transform, rotation, to_last in zip(transforms, rotations, relative, strict=True):
        z = rotation[:, 2]
        if transform.prismatic:
            linear.append(z)
            origin.append(z)
            angular.append(ca.SX([0.0, 0.0, 0.0]))
            turning.append(ca.SX([0.0, 0.0, 0.0]))
        else:
            linear.append(ca.cross(z, to_last + arm))
            origin.append(ca.cross(z, to_last))
            angular.append(z)
            turning.append(ca.cross(z, axis))
    return ToolKinematics(
        rotation=last,
        tip=transforms[0].translation + relative[0] + arm,
        axis=axis,
        linear_jacobian=ca.horzcat(*linear),
        angular_jacobian=ca.horzcat(*angular),
        axis_jacobian=ca.horzcat(*turning),
        origin_jacobian=ca.horzcat(*origin),
    )


def tool_accelerations(
    description: RobotDescription, rotation: ca.SX, last: LinkMotion
) -> tuple[ca.SX, ca.SX]:
    """Second derivatives of tool tip (m/s²) and tool axis (1/s²) in the base frame, (3, 1) each.

    With zero joint accelerations and no gravity these are J̇q̇. `rotation` is the last link
    frame's orientation.
    """
    matrix = last.acceleration_matrix()
    tip = last.acceleration + matrix @ ca.SX(description.tool_tip)
    return rotation @ tip, rotation @ (matrix @ ca.SX(description.tool_axis))


def select_task(description: RobotDescription, position: ca.SX, axis: ca.SX) -> ca.SX:
    """The task's rows out of base-frame rows for the tip and for the tool axis, (m, columns)."""
    task = description.task
    rows = [position[component, :] for component in task.position]
    return ca.vertcat(*rows, *(axis[component, :] for component in task.tool_axis))


def _transform(joint: Joint, variable: ca.SX) -> JointTransform:
    prismatic = joint.type is JointType.PRISMATIC
    cos_alpha, sin_alpha = _snap(math.cos(joint.alpha)), _snap(math.sin(joint.alpha))
    if prismatic:
        cos_theta, sin_theta = (
            ca.SX(_snap(function(joint.theta))) for function in (math.cos, math.sin)
        )
        r = joint.r + variable
    else:
        angle = joint.theta + variable
        cos_theta, sin_theta = ca.cos(angle), ca.sin(angle)
        r = ca.SX(joint.r)
    return JointTransform(
        cos_alpha=cos_alpha,
        sin_alpha=sin_alpha,
        cos_theta=cos_theta,
        sin_theta=sin_theta,
        translation=ca.vertcat(joint.d, -r * sin_alpha, r * cos_alpha),
        prismatic=prismatic,
    )


def _snap(value: float) -> float:
    nearest = float(round(value))
    return nearest + 0.0 if abs(value - nearest) < _SNAP else value


def _next_motion(
    link: LinkMotion, transform: JointTransform, rate: ca.SX, change: ca.SX
) -> LinkMotion:
    omega = transform.to_child(link.angular_velocity)
    alpha = transform.to_child(link.angular_acceleration)
    carried = link.acceleration + link.acceleration_matrix() @ transform.translation
    acceleration = transform.to_child(carried)
    # ω × z q̇, the turning of the joint axis with the link before.
    sweep = ca.vertcat(omega[1] * rate, -omega[0] * rate, 0)
    along = ca.vertcat(0, 0, change)
    if transform.prismatic:
        acceleration = acceleration + 2 * sweep + along
    else:
        omega = omega + ca.vertcat(0, 0, rate)
        alpha = alpha + sweep + along
    return LinkMotion(angular_velocity=omega, angular_acceleration=alpha, acceleration=acceleration)


def _base_frames(transforms: tuple[JointTransform, ...]) -> tuple[list[ca.SX], list[ca.SX]]:
    """Orientations in the base frame, and the way from each origin to the last one; length n."""
    rotation = ca.SX(np.eye(3))
    rotations, steps = [], []
    for transform in transforms:
        steps.append(rotation @ transform.translation)
        x, y, z = ca.horzsplit(rotation)
        y, z = (
            transform.cos_alpha * y + transform.sin_alpha * z,
            transform.cos_alpha * z - transform.sin_alpha * y,
        )
        x, y = (
            transform.cos_theta * x + transform.sin_theta * y,
            transform.cos_theta * y - transform.sin_theta * x,
        )
        rotation = ca.horzcat(x, y, z)
        rotations.append(rotation)
    relative = [ca.SX([0.0, 0.0, 0.0])]
    for step in reversed(steps[1:]):
        relative.insert(0, step + relative[0])
    return rotations, relative


def _rotate_tensor(
    tensor: ca.SX, cos: float | ca.SX, sin: float | ca.SX, axes: tuple[int, int, int]
) -> ca.SX:
    """R T Rᵀ for a turn about the third of `axes`, which run right-handed.

    Written with w = sin (Tii − Tjj) + 2 cos Tij, which takes ten operations instead of 45.
    """
    i, j, k = axes
    w = sin * (tensor[i, i] - tensor[j, j]) + 2 * cos * tensor[i, j]
    rotated = ca.SX(tensor)
    rotated[i, i] = tensor[i, i] - sin * w
    rotated[j, j] = tensor[j, j] + sin * w
    rotated[i, j] = rotated[j, i] = cos * w - tensor[i, j]
    rotated[i, k] = rotated[k, i] = cos * tensor[i, k] - sin * tensor[j, k]
    rotated[j, k] = rotated[k, j] = sin * tensor[i, k] + cos * tensor[j, k]
    return rotated
