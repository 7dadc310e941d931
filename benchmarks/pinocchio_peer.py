"""Pinocchio's C++ templates on the robot, compiled for this processor and called from C.

The headers come with the packages: Pinocchio's and Boost's with `pin`, Eigen's with CasADi.
"""

from __future__ import annotations

import ctypes
import hashlib
import shutil
import subprocess
import tempfile
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import casadi as ca
import numpy as np

from benchmarks.harness import Evaluate, pointers
from mrac_design.derivation_cache import cache_directory
from mrac_design.robot import JointType, RobotDescription

_SOURCE = """\
#include <pinocchio/algorithm/cholesky.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>
namespace pin = pinocchio;
using Vector = Eigen::Map<const Eigen::VectorXd>;
static pin::Model model;
static pin::Data data;
static Eigen::Vector3d tip;

/* Row per joint: slides, alpha, d, r, mass, centre of mass, inertia by its lower triangle,
   armature. */
extern "C" void prepare(long joints, const double *rows, const double *gravity, const double *at) {
    model = pin::Model();
    model.gravity.linear(Eigen::Vector3d(gravity));
    tip = Eigen::Vector3d(at);
    pin::JointIndex parent = 0;
    for (long i = 0; i < joints; ++i) {
        const double *row = rows + 15 * i;
        const double c = std::cos(row[1]), s = std::sin(row[1]);
        Eigen::Matrix3d turn;
        turn << 1, 0, 0, 0, c, -s, 0, s, c;
        const pin::SE3 place(turn, Eigen::Vector3d(row[2], -s * row[3], c * row[3]));
        const std::string name = std::to_string(i);
        parent = row[0] != 0 ? model.addJoint(parent, pin::JointModelPZ(), place, name)
                             : model.addJoint(parent, pin::JointModelRZ(), place, name);
        pin::Symmetric3 inertia(row[8], row[9], row[10], row[11], row[12], row[13]);
        model.appendBodyToJoint(parent, pin::Inertia(row[4], Eigen::Vector3d(row + 5), inertia));
    }
    for (long i = 0; i < joints; ++i) model.armature[i] = rows[15 * i + 14];
    data = pin::Data(model);
}

/* M, V + G, the tip's Jacobian and J̇q̇, q̈ by M's Cholesky factor. */
extern "C" void evaluate(long n, const double *q_, const double *qd_, const double *torque,
                         double *out) {
    const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);
    const pin::JointIndex last = model.njoints - 1;
    Eigen::VectorXd solution(model.nv);
    for (long i = 0; i < n; ++i) {
        double *o = out + (i % 64) * 65;
        const Vector q(q_ + 5 * i, 5), qd(qd_ + 5 * i, 5);
        pin::crba(model, data, q, pin::Convention::WORLD);
        Eigen::Map<Eigen::Matrix<double, 5, 5>> matrix(o);
        matrix = data.M.selfadjointView<Eigen::Upper>();
        Eigen::Map<Eigen::VectorXd> bias(o + 25, 5);
        bias = pin::nonLinearEffects(model, data, q, qd);
        Eigen::Map<Eigen::VectorXd> qdd(o + 60, 5);
        pin::cholesky::decompose(model, data);
        solution = Vector(torque + 5 * i, 5) - bias;
        pin::cholesky::solve(model, data, solution);
        qdd = solution;
        pin::forwardKinematics(model, data, q, qd, rest);
        const Eigen::Vector3d arm = data.oMi[last].rotation() * tip;
        const Eigen::Vector3d at = data.oMi[last].translation() + arm;
        Eigen::Map<Eigen::Matrix<double, 3, 5>> jacobian(o + 30);
        for (int j = 0; j < 5; ++j)
            jacobian.col(j) = data.J.col(j).head<3>() + data.J.col(j).tail<3>().cross(at);
        const pin::Motion drift = data.oMi[last].act(data.a[last]);
        const pin::Motion v = data.oMi[last].act(data.v[last]);
        const Eigen::Vector3d speed = v.linear() + v.angular().cross(at);
        Eigen::Map<Eigen::Vector3d> dot(o + 55);
        dot = drift.linear() + drift.angular().cross(at) + v.angular().cross(speed);
    }
}
"""
_FLAGS = (
    "-std=c++17", "-O3", "-march=native", "-DNDEBUG", "-fPIC", "-shared",
    # As Pinocchio's own build sets them: its joints are more than Boost's lists hold.
    "-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-DBOOST_FUSION_INVOKE_MAX_ARITY=12",
)  # fmt: skip


def _built(command: list[str]) -> Path:
    """The compiled harness, kept beside the simulations' programs."""
    key = hashlib.sha256("\n".join((*command, version("pin"), _SOURCE)).encode()).hexdigest()[:16]
    kept = cache_directory() / f"pinocchio-{key}.so"
    if not kept.exists():
        kept.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=kept.parent) as work:
            source, built = Path(work) / "harness.cpp", Path(work) / "harness.so"
            source.write_text(_SOURCE)
            subprocess.run(
                [*command, str(source), "-o", str(built)], check=True, capture_output=True
            )
            built.replace(kept)
    return kept


def pinocchio_harness(robot: RobotDescription, compiler: str) -> Evaluate:
    """See `harness`; raises ImportError or OSError where Pinocchio cannot be had.

    `compiler` is for C; the one for C++ is c++ or g++. It takes minutes and 3 GB, the first time.
    """
    if not find_spec("pinocchio"):
        raise ImportError("pin is not installed")
    import pinocchio

    headers = next(
        (
            folder / "include"
            for folder in Path(pinocchio.__file__).parents
            if (folder / "include" / "pinocchio").is_dir()
        ),
        None,
    )
    eigen = Path(ca.__file__).parent / "include" / "eigen3"
    command = shutil.which("c++") or shutil.which("g++")
    if headers is None or not eigen.is_dir() or command is None:
        raise OSError("Pinocchio's or Eigen's headers or a C++ compiler are missing")
    harness = ctypes.CDLL(str(_built([command, *_FLAGS, f"-I{headers}", f"-I{eigen}"])))
    rows = np.array(
        [
            (
                joint.type is JointType.PRISMATIC,
                joint.alpha,
                joint.d,
                0.0 if joint.type is JointType.PRISMATIC else joint.r,
                body.mass,
                *body.centre_of_mass,
                *(body.inertia[i, k] for i, k in ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))),
                joint.drive_inertia,
            )
            for joint, body in zip(robot.joints, robot.bodies, strict=True)
        ]
    )
    gravity, tip = (np.array(v, dtype=float) for v in (robot.gravity, robot.tool_tip))
    harness.prepare(ctypes.c_long(len(rows)), *pointers(rows, gravity, tip))
    return harness.evaluate
