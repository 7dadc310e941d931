"""The robot: description, files, kinematics, rigid-body dynamics and task space.

parts → description → parameters, kinematics → rigid_body → dynamics → task_space, posture. A
`RobotDescription` holds numbers, `build_dynamics` turns it into CasADi functions,
`build_task_space` into Mx, Vx and Gx.
"""

from __future__ import annotations

from mrac_design.robot.description import RobotDescription
from mrac_design.robot.dynamics import RobotDynamics, build_dynamics
from mrac_design.robot.loading import available_robots, load_robot
from mrac_design.robot.parameters import (
    friction_parameters,
    inertial_parameters,
    parameter_names,
    scaled_parameters,
)
from mrac_design.robot.parts import AXIS_NAMES, Body, Joint, JointType, TaskDefinition
from mrac_design.robot.posture import check_posture, condition_number, condition_numbers
from mrac_design.robot.task_space import TaskSpaceModel, build_task_space

__all__ = [
    "AXIS_NAMES",
    "Body",
    "Joint",
    "JointType",
    "RobotDescription",
    "RobotDynamics",
    "TaskDefinition",
    "TaskSpaceModel",
    "available_robots",
    "build_dynamics",
    "build_task_space",
    "check_posture",
    "condition_number",
    "condition_numbers",
    "friction_parameters",
    "inertial_parameters",
    "load_robot",
    "parameter_names",
    "scaled_parameters",
]
