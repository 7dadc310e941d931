"""Tuned gains as a value: all that the controller of a force axis is made from, and nothing else.

    scenario, design ─► gain_set ─► GainSet ─► controller_of ─► build_step
                                      │  ▲
                                documents and files

Whatever way a `GainSet` has travelled, the step built from it has the same parameters bit for bit.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field, fields, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from mrac_design.arrays import readonly
from mrac_design.controller.adaptation import AdaptationLaw
from mrac_design.controller.adaptive import AdaptiveRST, build_step
from mrac_design.controller.linearisation import RobotModelError, build_linearisation
from mrac_design.controller.reference import DirectReference, ModelInverse
from mrac_design.controller.robot_step import RobotStep, build_robot_step
from mrac_design.design import ReferenceModel, RSTDesign, RSTSpecification, design_rst
from mrac_design.errors import ModelFileError, ParameterError
from mrac_design.polynomials.diophantine import RESIDUAL_LIMIT, relative_residual
from mrac_design.resources import models_directory
from mrac_design.robot import available_robots, build_dynamics, load_robot
from mrac_design.simulation.scenario import Scenario
from mrac_design.study import VARIANTS, Variant, variant_controller
from mrac_design.time_domain import Continuous, Discrete, TimeDomain

# T follows from Ao by one product; another processor may round it otherwise.
_T_TOLERANCE = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotFingerprint:
    """Which robot file the gains were made for."""

    file: str
    """Name of the robot file, without its folder."""
    sha256: str
    """SHA-256 of the file's bytes, hexadecimal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GainSet:
    """A tuned controller, the same on every force axis; compares by value.

    Raises ParameterError when a number is out of its range or the coefficients do not solve the
    Diophantine equation of the specification.
    """

    scenario: str
    """Name of the scenario the gains come from."""
    package_version: str
    """Version of mrac_design that made them."""
    robot: RobotFingerprint
    """The robot file they were made for."""
    specification: RSTSpecification
    """Plant (Ks, K2), reference model (ω, ξ), observer Ao and internal model D."""
    coefficients: tuple[float, ...]
    """(r1, s0 … sn, t0 … tn) of R = (p + r1) D, S = s0 pⁿ + … + sn and T likewise, SI units."""
    initial_gains: tuple[float, ...]
    """θ̂(0), scaled start of (r1 − c, s0 … sn, t0 … tn), dimensionless."""
    prefilter: ReferenceModel | None
    """Pre-filter of the force reference; none: F_d = r."""
    feedforward: DirectReference | ModelInverse
    """What enters the loop as u_c."""
    law: AdaptationLaw
    """How the gains move."""
    bias_force: float
    """Size of the constant regressor (N); 0 leaves it out."""
    tool_axis_bandwidth: float
    """Bandwidth of the PD control of the tool axis (rad/s)."""
    robot_model: RobotModelError
    """Factors on the robot file's numbers in the linearising torque."""
    design: RSTDesign = field(init=False, compare=False, repr=False)
    """The design with exactly these coefficients, its residual evaluated at them."""

    def __post_init__(self) -> None:
        count = len(self.specification.gain_names)
        if len(self.coefficients) != count or not np.all(np.isfinite(self.coefficients)):
            raise ParameterError("gains", self.coefficients, f"needs {count} finite numbers")
        if not 0 < self.tool_axis_bandwidth < math.inf:
            raise ParameterError("tool_axis_bandwidth", self.tool_axis_bandwidth, "must be > 0")
        object.__setattr__(self, "design", _design(self.specification, self.coefficients))
        controller = controller_of(self, Continuous())  # refuses what no controller can have
        self.law.parameters(len(controller.gain_names))

    def _repr_markdown_(self) -> str:
        return self.design._repr_markdown_()


def gain_set(scenario: Scenario, design: RSTDesign, variant: Variant = VARIANTS[-1]) -> GainSet:
    """The gains of one of a study's controllers, by default the adaptive one with model inverse.

    Raises ModelFileError when the scenario's robot file cannot be read, ParameterError when the
    controller holds something that a gain set does not.
    """
    controller = variant_controller(scenario, design, variant)
    feedforward = controller.feedforward
    assert isinstance(feedforward, DirectReference | ModelInverse)
    gains = GainSet(
        scenario=scenario.name,
        package_version=version("mrac-design"),
        robot=robot_fingerprint(scenario.robot),
        specification=design.specification,
        coefficients=tuple(value for _, value, _ in design.coefficients),
        initial_gains=controller.initial_gains,
        prefilter=controller.prefilter,
        feedforward=feedforward,
        law=controller.law,
        bias_force=controller.bias_force,
        tool_axis_bandwidth=scenario.design.tool_axis_bandwidth,
        robot_model=scenario.model_error,
    )
    _require_complete(gains, controller)
    return gains


def controller_of(gains: GainSet, time_domain: TimeDomain) -> AdaptiveRST:
    """The controller of one force axis, for `build_step`, continuous or sampled."""
    return AdaptiveRST(
        design=gains.design,
        prefilter=gains.prefilter,
        law=gains.law,
        feedforward=gains.feedforward,
        bias_force=gains.bias_force,
        initial_gains=gains.initial_gains,
        time_domain=time_domain,
    )


def robot_step_of(gains: GainSet, robot: str, time_domain: Discrete) -> RobotStep:
    """The whole robot's controller: these gains on every force axis of `robot`.

    `robot` is a packaged robot or a robot file. Raises ModelFileError when it is not the file
    the gains were made for.
    """
    require_robot(gains, robot)
    dynamics = build_dynamics(load_robot(robot))
    linearisation = build_linearisation(
        dynamics,
        velocity_gain=gains.specification.plant.velocity_gain,
        tool_axis_bandwidth=gains.tool_axis_bandwidth,
        model_error=gains.robot_model,
    )
    step = build_step(controller_of(gains, time_domain))
    axes = len(dynamics.description.force_axes)
    return build_robot_step(dynamics, linearisation, [step] * axes, time_domain=time_domain)


def require_robot(gains: GainSet, robot: str) -> None:
    """Raise ModelFileError when `robot` is not the robot file the gains were made for."""
    found = robot_fingerprint(robot)
    if found.sha256 != gains.robot.sha256:
        raise ModelFileError(
            robot,
            "",
            f"is not the robot the gains were made for: SHA-256 {found.sha256[:12]}… instead of "
            f"{gains.robot.sha256[:12]}… ({gains.robot.file}); give that file, or design anew",
        )


def robot_fingerprint(robot: str) -> RobotFingerprint:
    """Fingerprint of a packaged robot or a robot file; raises ModelFileError if unreadable."""
    path = Path(robot)
    if robot in available_robots():
        path = models_directory() / "robots" / f"{robot}.toml"
    try:
        content = path.read_bytes()
    except OSError as problem:
        raise ModelFileError(path, "", f"cannot be read: {problem.strerror}") from problem
    return RobotFingerprint(file=path.name, sha256=hashlib.sha256(content).hexdigest())


def _require_complete(gains: GainSet, controller: AdaptiveRST) -> None:
    """Nothing of a controller may get lost on its way into a gain set."""
    back = controller_of(gains, controller.time_domain)
    for entry in fields(controller):
        kept, own = getattr(back, entry.name), getattr(controller, entry.name)
        if entry.name != "design" and kept != own:
            raise ParameterError(entry.name.replace("_", " "), own, "has no place in a gain set")


def _design(specification: RSTSpecification, coefficients: tuple[float, ...]) -> RSTDesign:
    """The design of `specification` with the given coefficients put in and judged."""
    r1, *rest = coefficients
    S, T = np.split(np.array(rest), 2)
    R = np.convolve([1.0, r1], specification.internal_model)
    solved = design_rst(specification).solved
    problem = specification.placement
    residual = relative_residual(problem.process.A, problem.process.B, problem.closed_loop, R, S)
    if not residual <= RESIDUAL_LIMIT:
        raise ParameterError(
            "gains",
            coefficients,
            f"leave a residual of {residual:.2g} in A R + b0 S = Ao Am, more than "
            f"{RESIDUAL_LIMIT:g}: they do not belong to this design",
        )
    if not np.allclose(T, solved.T, rtol=_T_TOLERANCE, atol=0.0):
        wanted = ", ".join(f"{value:.9g}" for value in solved.T)
        names = ", ".join(specification.gain_names[-len(T) :])
        raise ParameterError(names, tuple(T.tolist()), f"must be ω²/b0 times Ao: {wanted}")
    placed = replace(solved, R=readonly(R), S=readonly(S), T=readonly(T), residual=residual)
    return RSTDesign(specification=specification, solved=placed)
