"""Equations of motion of a serial chain in symbols: M(q) q̈ + C(q, q̇) q̇ + G(q) = Γ.

Inverse dynamics by the recursive Newton-Euler method (Luh, Walker, Paul 1980; with first
moments and inertias at the link origins, Khalil and Dombre, ch. 9), the mass matrix by
composite rigid bodies (Walker and Orin 1982).
"""

from __future__ import annotations

from collections.abc import Sequence

import casadi as ca

from mrac_design.robot.kinematics import JointTransform, LinkMotion
from mrac_design.robot.parameters import BodyInertia


def joint_efforts(
    transforms: Sequence[JointTransform],
    links: Sequence[LinkMotion],
    bodies: Sequence[BodyInertia],
    qdd: ca.SX,
) -> ca.SX:
    """Inward recursion of forces: efforts Γ that produce the given motion, shape (n, 1)."""
    force = moment = ca.SX([0.0, 0.0, 0.0])
    efforts: list[ca.SX] = []
    for index in reversed(range(len(bodies))):
        own_force, own_moment = _body_wrench(links[index], bodies[index])
        force, moment = own_force + force, own_moment + moment
        transform = transforms[index]
        along = force[2] if transform.prismatic else moment[2]
        efforts.insert(0, along + bodies[index].drive_inertia * qdd[index])
        force, moment = _wrench_to_parent(transform, force, moment)
    return ca.vertcat(*efforts)


def mass_matrix(transforms: Sequence[JointTransform], bodies: Sequence[BodyInertia]) -> ca.SX:
    """M by composite rigid bodies, drive inertia on the diagonal, shape (n, n)."""
    n = len(bodies)
    matrix = ca.SX.zeros(n, n)
    mass, moment, inertia = ca.SX(0), ca.SX.zeros(3, 1), ca.SX.zeros(3, 3)
    for j in reversed(range(n)):
        mass = mass + bodies[j].mass
        moment = moment + bodies[j].first_moment
        inertia = inertia + bodies[j].inertia
        transform = transforms[j]
        force, torque = _unit_acceleration_wrench(transform, mass, moment, inertia)
        along = force[2] if transform.prismatic else torque[2]
        matrix[j, j] = along + bodies[j].drive_inertia
        for i in reversed(range(j)):
            force, torque = _wrench_to_parent(transforms[i + 1], force, torque)
            along = force[2] if transforms[i].prismatic else torque[2]
            matrix[i, j] = matrix[j, i] = along
        mass, moment, inertia = _composite_to_parent(transform, mass, moment, inertia)
    return matrix


def coriolis_matrix(
    transforms: Sequence[JointTransform], bodies: Sequence[BodyInertia], qd: ca.SX
) -> ca.SX:
    """C with C q̇ the Coriolis and centrifugal efforts and Ṁ − 2C skew-symmetric, shape (n, n).

    Sum over the bodies of Jᵀ(𝕀 J̇ + B J) in link components, where 𝕀 is the constant spatial
    inertia and B = −[[L]×, [P]×; [P]×, 0] with the momenta (L, P) = 𝕀 J q̇. B is skew, hence
    Ṁ − 2C is (the argument of Slotine and Li 1987, for spatial vectors); C is not unique.
    """
    n = len(bodies)
    rates = ca.vertsplit(qd)
    # Columns of J and J̇: angular part above linear part.
    columns = [ca.SX.zeros(6, 1) for _ in range(n)]
    derivatives = [ca.SX.zeros(6, 1) for _ in range(n)]
    matrix = ca.SX.zeros(n, n)
    for index, (transform, body) in enumerate(zip(transforms, bodies, strict=True)):
        for k in range(index):
            columns[k] = _twist_to_child(transform, columns[k])
            moved = _twist_to_child(transform, derivatives[k])
            derivatives[k] = moved - _own_motion_cross(transform, rates[index], columns[k])
        columns[index] = ca.SX([0, 0, 0, 0, 0, 1] if transform.prismatic else [0, 0, 1, 0, 0, 0])
        jacobian = ca.horzcat(*columns[: index + 1])
        derivative = ca.horzcat(*derivatives[: index + 1])
        velocity = jacobian @ qd[: index + 1]
        inertia = _spatial_inertia(body)
        angular, linear = ca.vertsplit(inertia @ velocity, 3)
        turn, push = ca.skew(angular), ca.skew(linear)
        skew = -ca.blockcat([[turn, push], [push, ca.SX.zeros(3, 3)]])
        matrix[: index + 1, : index + 1] += jacobian.T @ (inertia @ derivative + skew @ jacobian)
    return ca.densify(matrix)


def kinetic_energy(matrix: ca.SX, qd: ca.SX) -> ca.SX:
    """½ q̇ᵀ M q̇ (J), drives included, scalar."""
    return ca.dot(qd, matrix @ qd) / 2


def potential_energy(
    transforms: Sequence[JointTransform], bodies: Sequence[BodyInertia], gravity: ca.SX
) -> ca.SX:
    """Potential energy in the field of gravity (J), zero with all centres at the base origin."""
    energy = ca.SX(0)
    mass, moment = ca.SX(0), ca.SX.zeros(3, 1)
    for transform, body in zip(reversed(transforms), reversed(bodies), strict=True):
        mass, moment = mass + body.mass, moment + body.first_moment
        moment = transform.to_parent(moment) + mass * transform.translation
    return energy - ca.dot(gravity, moment)


def _body_wrench(link: LinkMotion, body: BodyInertia) -> tuple[ca.SX, ca.SX]:
    """Force and moment about the link origin that move a body: m a + U h, I ω̇ + ω × I ω + h × a.

    The moment's terms are gathered so that they reuse the products in U.
    """
    u = link.acceleration_matrix()
    x, y, z = ca.vertsplit(link.angular_velocity)
    ax, ay, az = ca.vertsplit(link.angular_acceleration)
    inertia = body.inertia
    xx, yy, zz = inertia[0, 0], inertia[1, 1], inertia[2, 2]
    xy, xz, yz = inertia[0, 1], inertia[0, 2], inertia[1, 2]
    turning = ca.vertcat(
        xx * ax + (zz - yy) * (y * z) - xy * u[2, 0] + xz * u[1, 0] + yz * (u[1, 1] - u[2, 2]),
        yy * ay + (xx - zz) * (x * z) + xy * u[2, 1] - yz * u[0, 1] + xz * (u[2, 2] - u[0, 0]),
        zz * az + (yy - xx) * (x * y) - xz * u[1, 2] + yz * u[0, 2] + xy * (u[0, 0] - u[1, 1]),
    )
    force = body.mass * link.acceleration + u @ body.first_moment
    return force, turning + ca.cross(body.first_moment, link.acceleration)


def _wrench_to_parent(
    transform: JointTransform, force: ca.SX, moment: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """The same wrench about the parent frame's origin, in its components."""
    turned = transform.to_parent(force)
    return turned, transform.to_parent(moment) + ca.cross(transform.translation, turned)


def _unit_acceleration_wrench(
    transform: JointTransform, mass: ca.SX, moment: ca.SX, inertia: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Wrench that gives a composite body at rest unit acceleration along or about its z."""
    x, y, _ = ca.vertsplit(moment)
    if transform.prismatic:
        return ca.vertcat(0, 0, mass), ca.vertcat(y, -x, 0)
    return ca.vertcat(-y, x, 0), inertia[:, 2]


def _composite_to_parent(
    transform: JointTransform, mass: ca.SX, moment: ca.SX, inertia: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Mass, first moment and inertia of a composite body about the parent frame's origin."""
    p = transform.translation
    turned = transform.to_parent(moment)
    # −[p]×[h]× − [h]×[p]× − m [p]×[p]×, with k = h + m p / 2 so that both are one product.
    k = turned + mass * p / 2
    shift = 2 * ca.dot(p, k) * ca.SX(ca.DM.eye(3)) - p @ k.T - k @ p.T
    return mass, turned + mass * p, transform.tensor_to_parent(inertia) + ca.densify(shift)


def _spatial_inertia(body: BodyInertia) -> ca.SX:
    """𝕀 at the link origin for twists (ω, v), shape (6, 6)."""
    h = ca.skew(body.first_moment)
    return ca.blockcat([[body.inertia, h], [-h, body.mass * ca.SX.eye(3)]])


def _twist_to_child(transform: JointTransform, twist: ca.SX) -> ca.SX:
    """A twist (ω, v) at the child frame's origin, in its components."""
    angular, linear = ca.vertsplit(twist, 3)
    carried = linear + ca.cross(angular, transform.translation)
    return ca.vertcat(transform.to_child(angular), transform.to_child(carried))


def _own_motion_cross(transform: JointTransform, rate: ca.SX, twist: ca.SX) -> ca.SX:
    """Spatial cross product of the joint's own motion z q̇ with a twist."""
    angular, linear = ca.vertsplit(twist, 3)
    spin = ca.vertcat(0, 0, rate)
    if transform.prismatic:
        return ca.vertcat(ca.SX.zeros(3, 1), ca.cross(spin, angular))
    return ca.vertcat(ca.cross(spin, angular), ca.cross(spin, linear))
