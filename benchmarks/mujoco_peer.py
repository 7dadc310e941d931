"""MuJoCo's C functions on the robot, called from C."""

from __future__ import annotations

import ctypes
import math
import shlex
import subprocess
import tempfile
from importlib.util import find_spec
from pathlib import Path

from benchmarks.harness import Evaluate
from mrac_design.robot import JointType, RobotDescription

_SOURCE = """\
#include <mujoco/mujoco.h>
static mjModel *m; static mjData *d; static int site;
int prepare(const char *path) {
    char error[500] = "";
    m = mj_loadXML(path, 0, error, 500);
    if (!m) return 1;
    d = mj_makeData(m);
    site = mj_name2id(m, mjOBJ_SITE, "tip");
    return 0;
}
/* Positions, velocities, M, its factor, bias, the tip's Jacobian and accelerations, no contact. */
void evaluate(long n, const double *q, const double *qd, const double *torque, double *out) {
    double jacp[15], jacr[15], dotp[15], dotr[15];
    const int body = m->site_bodyid[site];
    for (long i = 0; i < n; ++i) {
        double *o = out + (i % 64) * 65;
        mju_copy(d->qpos, q + 5 * i, 5);
        mju_copy(d->qvel, qd + 5 * i, 5);
        mj_kinematics(m, d); mj_comPos(m, d); mj_crb(m, d); mj_factorM(m, d);
        mj_comVel(m, d); mj_rne(m, d, 0, d->qfrc_bias);
        mj_fullM(m, d, o);
        mju_copy(o + 25, d->qfrc_bias, 5);
        mj_jac(m, d, jacp, jacr, d->site_xpos + 3 * site, body);
        mj_jacDot(m, d, dotp, dotr, d->site_xpos + 3 * site, body);
        mju_copy(o + 30, jacp, 15);
        mju_mulMatVec(o + 55, dotp, d->qvel, 3, 5);
        mju_sub(o + 60, torque + 5 * i, d->qfrc_bias, 5);
        mj_solveM(m, d, o + 60, o + 60, 1);
    }
}
"""


def mujoco_harness(robot: RobotDescription, compiler: str) -> Evaluate:
    """See `harness`; raises ImportError or OSError where MuJoCo cannot be had."""
    if not find_spec("mujoco"):
        raise ImportError("mujoco is not installed")
    import mujoco

    folder = Path(mujoco.__file__).parent
    library = next(folder.glob("libmujoco.so*"))
    with tempfile.TemporaryDirectory(prefix="bench-") as work:
        model = Path(work) / "robot.xml"
        model.write_text(_model(robot))
        source, built = Path(work) / "harness.c", Path(work) / "harness.so"
        source.write_text(_SOURCE)
        subprocess.run(
            [
                *shlex.split(compiler), "-O3", "-march=native", "-fPIC", "-shared",
                f"-I{folder / 'include'}", str(source), str(library), f"-Wl,-rpath,{folder}",
                "-o", str(built),
            ],
            check=True, capture_output=True,
        )  # fmt: skip
        harness = ctypes.CDLL(str(built))
        if harness.prepare(str(model).encode()):
            raise OSError("MuJoCo refuses the model")
    return harness.evaluate


def _model(robot: RobotDescription) -> str:
    """The robot in MuJoCo's format; frames are those of the modified Denavit–Hartenberg rows."""
    opened, closed = [], []
    for joint, body in zip(robot.joints, robot.bodies, strict=True):
        slides = joint.type is JointType.PRISMATIC
        r = 0.0 if slides else joint.r
        place = (joint.d, -math.sin(joint.alpha) * r, math.cos(joint.alpha) * r)
        turn = (math.cos(joint.alpha / 2), math.sin(joint.alpha / 2), 0.0, 0.0)
        inertia = body.inertia
        six = (inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2],
               inertia[1, 2])  # fmt: skip
        opened.append(
            f'<body pos="{_row(place)}" quat="{_row(turn)}">'
            f'<joint type="{"slide" if slides else "hinge"}" axis="0 0 1" '
            f'armature="{joint.drive_inertia!r}"/>'
            f'<inertial mass="{body.mass!r}" pos="{_row(body.centre_of_mass)}" '
            f'fullinertia="{_row(six)}"/>'
        )
        closed.append("</body>")
    tip = f'<site name="tip" pos="{_row(robot.tool_tip)}"/>'
    return (
        f'<mujoco><option gravity="{_row(robot.gravity)}"/><compiler angle="radian"/>'
        f"<worldbody>{''.join(opened)}{tip}{''.join(closed)}</worldbody></mujoco>"
    )


def _row(values) -> str:
    return " ".join(repr(float(value)) for value in values)
