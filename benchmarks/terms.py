"""M, V + G, tool Jacobian, J̇q̇ and forward dynamics of the five-joint robot in one evaluation."""

from __future__ import annotations

import ctypes
import math
import shlex
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import casadi as ca
import numpy as np

from benchmarks.measure import Result, interleaved, timed
from mrac_design.codegen.c_source import c_routine, support
from mrac_design.codegen.passes import hoist_settled, share_reciprocals
from mrac_design.codegen.reading import operations_as_written, read_function
from mrac_design.robot import (
    JointType,
    RobotDescription,
    RobotDynamics,
    build_dynamics,
    inertial_parameters,
    load_robot,
)
from mrac_design.simulation.compilation import compile_library
from mrac_design.simulation.stepping import finished

COUNT = 1024
"""Postures evaluated in a call: few enough to stay in the cache."""

_HARNESS = """\
#include <stddef.h>
{support}
{setup}
{body}
/* n groups of postures; q, qd, torque are (groups, 5) of lanes, results (64 / lanes, 65). */
void evaluate(long n, const real *q, const real *qd, const real *torque, const real *p, real *out)
{{
    real prepared[{prepared} + 1];
    setup(p, prepared);
    for (long i = 0; i < n; ++i) {{
        real *o = out + (size_t)(i % (64 / LANES)) * 65;
        terms(q + 5 * i, qd + 5 * i, torque + 5 * i, p, prepared, o, o + 25, o + 30, o + 55,
              o + 60);
    }}
}}
"""

_MUJOCO = """\
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


@dataclass(slots=True)
class _Evaluator:
    name: str
    call: Callable[[], object]
    per_call: int
    setup: float
    note: str = ""


def rigid_body_terms(compiler: str, *, rounds: int, say) -> list[Result]:
    """Processor time (ns) of one evaluation; everybody is checked on M, V + G and q̈ first."""
    robot = load_robot("d2m2_set_a")
    dynamics = build_dynamics(robot)
    generator = np.random.default_rng(3)
    q = robot.home + generator.uniform(-0.3, 0.3, (COUNT, 5))
    qd, torque = generator.normal(size=(2, COUNT, 5))
    truth = _truth(dynamics, q[:64], qd[:64], torque[:64])
    _say_counts(dynamics, compiler, say)
    found = [_ours(dynamics, compiler, lanes, q, qd, torque, truth) for lanes in (8, 1)]
    for make in (_mujoco, _pinocchio, _casadi_map):
        try:
            found.append(make(robot, dynamics, compiler, q, qd, torque, truth))
        except (ImportError, OSError, subprocess.CalledProcessError) as problem:
            say(f"{make.__name__.strip('_')} is left out: {str(problem).splitlines()[0]}")
    times = interleaved({e.name: e.call for e in found}, rounds=rounds)
    return [
        Result(name=e.name, cost=1e9 * times[e.name] / e.per_call, error=None, setup=e.setup,
               note=e.note)
        for e in found
    ]  # fmt: skip


def _say_counts(dynamics: RobotDynamics, compiler: str, say) -> None:
    """Operation counts, and the time below which two floating-point units cannot go."""
    function = dynamics.rigid_body_terms
    program = share_reciprocals(read_function(function), settled=["parameters"])
    _, body = hoist_settled(program, ["parameters"])
    say(f"rigid-body terms as written: {operations_as_written(function)._repr_markdown_()}")
    say(f"after optimisation: {body.count()._repr_markdown_()}")
    products = finished(body).count().products
    clock = _cycles_per_second(compiler)
    scalar = 1e9 * products / 2 / clock
    say(
        f"limit of two multipliers: {products} products, sines written out, many fused with sums, "
        f"in cycles of {1e9 / clock:.3f} ns: {scalar:.1f} ns scalar, {scalar / 8:.1f} ns on 8 lanes"
    )


def _cycles_per_second(compiler: str) -> float:
    """Clock under load, from a loop of one dependent addition a cycle."""
    source = """
    long count(long n) {
        long x = 0;
        for (long i = 0; i < n; ++i) { x += i; __asm__ volatile("" : "+r"(x)); }
        return x;
    }
    """
    library = compile_library(source, compiler)
    n = 20_000_000
    seconds = interleaved({"it": lambda: library.count(ctypes.c_long(n))}, rounds=5)["it"]
    return n / seconds


def _truth(dynamics: RobotDynamics, q, qd, torque) -> dict[str, np.ndarray]:
    p = inertial_parameters(dynamics.description)
    rows = [dynamics.rigid_body_terms(*row, p) for row in zip(q, qd, torque, strict=True)]
    matrix, bias, _, _, qdd = (np.array([np.array(r[i]).T.ravel() for r in rows]) for i in range(5))
    return {"matrix": matrix, "bias": bias, "qdd": qdd}


def _check(name: str, out: np.ndarray, truth: dict[str, np.ndarray]) -> None:
    """Fails unless M, V + G and q̈ are right; `out` is (64, 65)."""
    parts = {"matrix": out[:, :25], "bias": out[:, 25:30], "qdd": out[:, 60:65]}
    for key, value in parts.items():
        scale = np.abs(truth[key]).max()
        if np.abs(value - truth[key]).max() > 1e-9 * scale:
            raise OSError(f"{name} gives another {key}")


def _ours(dynamics, compiler, lanes, q, qd, torque, truth) -> _Evaluator:
    def build():
        program = share_reciprocals(
            read_function(dynamics.rigid_body_terms), settled=["parameters"]
        )
        setup, body = hoist_settled(program, ["parameters"])
        return compile_library(
            _HARNESS.format(
                support=support(lanes),
                setup=c_routine(setup, "setup", inputs=["parameters"]),
                body=c_routine(finished(body), "terms"),
                prepared=len(setup.output("prepared")),
            ),
            compiler,
        ).evaluate

    evaluate, seconds = timed(build)
    arrays = [_in_lanes(values, lanes) for values in (q, qd, torque)]
    parameters = inertial_parameters(dynamics.description)
    wide = _in_lanes(np.repeat(parameters[None, :], lanes, axis=0), lanes)
    out = _in_lanes(np.zeros((64, 65)), lanes)
    pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (*arrays, wide, out)]
    groups = COUNT // lanes
    evaluate(ctypes.c_long(64 // lanes), *pointers)
    flat = out.transpose(0, 2, 1).reshape(64, 65)
    name = f"mrac_design, {lanes} lanes" if lanes > 1 else "mrac_design, scalar"
    _check(name, flat, truth)
    return _Evaluator(name, lambda: evaluate(ctypes.c_long(groups), *pointers), COUNT, seconds)


def _in_lanes(values: np.ndarray, lanes: int) -> np.ndarray:
    """(groups, columns, lanes), beginning at a multiple of 64 bytes."""
    raw = np.zeros(values.size + 8)
    first = (-raw.ctypes.data // 8) % 8
    result = raw[first : first + values.size].reshape(-1, values.shape[1], lanes)
    result[:] = values.reshape(-1, lanes, values.shape[1]).transpose(0, 2, 1)
    return result


def _mujoco(robot, dynamics, compiler, q, qd, torque, truth) -> _Evaluator:
    if not find_spec("mujoco"):
        raise ImportError("mujoco is not installed")
    import mujoco

    folder = Path(mujoco.__file__).parent
    library = next(folder.glob("libmujoco.so*"))
    work = Path(tempfile.mkdtemp(prefix="bench-"))
    (work / "robot.xml").write_text(mujoco_model(robot))
    (work / "harness.c").write_text(_MUJOCO)
    subprocess.run(
        [
            *shlex.split(compiler), "-O3", "-march=native", "-fPIC", "-shared",
            f"-I{folder / 'include'}", str(work / "harness.c"), str(library),
            f"-Wl,-rpath,{folder}", "-o", str(work / "harness.so"),
        ],
        check=True, capture_output=True,
    )  # fmt: skip
    harness = ctypes.CDLL(str(work / "harness.so"))
    if harness.prepare(str(work / "robot.xml").encode()):
        raise OSError("MuJoCo refuses the model")
    out = np.zeros((64, 65))
    pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (q, qd, torque, out)]
    harness.evaluate(ctypes.c_long(64), *pointers)
    _check("MuJoCo", out, truth)
    return _Evaluator(
        "MuJoCo C", lambda: harness.evaluate(ctypes.c_long(COUNT), *pointers), COUNT, 0.0,
        "called from C, no Python between",
    )  # fmt: skip


def mujoco_model(robot: RobotDescription) -> str:
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


def _pinocchio(robot, dynamics, compiler, q, qd, torque, truth) -> _Evaluator:
    if not find_spec("pinocchio"):
        raise ImportError("pinocchio is not installed")
    import pinocchio as pin

    model = pin.Model()
    model.gravity = pin.Motion(np.array(robot.gravity), np.zeros(3))
    parent = 0
    for joint, body in zip(robot.joints, robot.bodies, strict=True):
        slides = joint.type is JointType.PRISMATIC
        kind = pin.JointModelPZ() if slides else pin.JointModelRZ()
        c, s = math.cos(joint.alpha), math.sin(joint.alpha)
        turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
        r = 0.0 if slides else joint.r
        place = pin.SE3(turn, np.array([joint.d, -s * r, c * r]))
        parent = model.addJoint(parent, kind, place, joint.name)
        inertia = pin.Inertia(body.mass, np.array(body.centre_of_mass), np.array(body.inertia))
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    model.armature = np.array([joint.drive_inertia for joint in robot.joints])
    data = model.createData()
    few = 512

    def one(i: int) -> np.ndarray:
        out = np.zeros(65)
        upper = np.triu(pin.crba(model, data, q[i]))
        out[:25] = (upper + np.triu(upper, 1).T).ravel()
        out[25:30] = pin.nonLinearEffects(model, data, q[i], qd[i])
        out[60:65] = pin.aba(model, data, q[i], qd[i], torque[i])
        return out

    _check("Pinocchio", np.array([one(i) for i in range(64)]), truth)

    def all_of_it() -> None:
        for i in range(few):
            pin.crba(model, data, q[i])
            pin.nonLinearEffects(model, data, q[i], qd[i])
            pin.computeJointJacobians(model, data, q[i])
            pin.computeJointJacobiansTimeVariation(model, data, q[i], qd[i])
            pin.aba(model, data, q[i], qd[i], torque[i])

    def empty() -> None:
        for i in range(few):
            for _ in range(5):
                pin.neutral(model)
            _ = (q[i], qd[i], torque[i])

    cost = interleaved({"all": all_of_it, "empty": empty}, rounds=5)
    overhead = 1e9 * cost["empty"] / few
    return _Evaluator(
        "Pinocchio C++ through Python", all_of_it, few, 0.0,
        f"five calls from Python, of which about {overhead:.0f} ns are the calls themselves",
    )  # fmt: skip


def _casadi_map(robot, dynamics, compiler, q, qd, torque, truth) -> _Evaluator:
    mapped = dynamics.rigid_body_terms.map(COUNT)
    inputs = [ca.DM(values.T) for values in (q, qd, torque)]
    p = ca.repmat(ca.DM(inertial_parameters(robot)), 1, COUNT)
    return _Evaluator("CasADi's own machine, map", lambda: mapped(*inputs, p), COUNT, 0.0)
