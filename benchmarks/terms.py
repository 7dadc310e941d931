"""M, V + G, tool Jacobian, J̇q̇ and forward dynamics of the five-joint robot in one evaluation."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from benchmarks.harness import COLUMNS, COUNT, ROWS, aligned, pointers
from benchmarks.limit import CHAINS, limit_source
from benchmarks.measure import Result, interleaved, timed
from benchmarks.mujoco_peer import mujoco_harness
from benchmarks.pinocchio_peer import pinocchio_harness
from mrac_design.codegen.c_source import c_routine, support
from mrac_design.codegen.passes import hoist_settled, share_reciprocals
from mrac_design.codegen.reading import operations_as_written, read_function
from mrac_design.codegen.straight_line import StraightLine
from mrac_design.robot import (
    RobotDescription,
    RobotDynamics,
    build_dynamics,
    inertial_parameters,
    load_robot,
)
from mrac_design.simulation.compilation import compile_library
from mrac_design.simulation.stepping import finished

LANES = 8
OURS, OURS_LANES = "mrac_design, scalar", f"mrac_design, {LANES} lanes"
MUJOCO, PINOCCHIO = "MuJoCo C", "Pinocchio C++"
LIMIT, LIMIT_LANES = "floating-point limit, scalar", f"floating-point limit, {LANES} lanes"

_SOURCE = """\
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


@dataclass(slots=True)
class _Evaluator:
    name: str
    call: Callable[[], object]
    setup: float
    note: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class _Postures:
    q: np.ndarray
    qd: np.ndarray
    torque: np.ndarray
    truth: dict[str, np.ndarray]


def rigid_body_terms(compiler: str, *, rounds: int, say) -> list[Result]:
    """Processor time (ns) of one evaluation; everybody is checked on M, V + G and q̈ first."""
    robot = load_robot("d2m2_set_a")
    dynamics = build_dynamics(robot)
    postures = _postures(dynamics)
    _, body = _programs(dynamics)
    say(f"rigid-body terms as written: {_counted(operations_as_written(_terms(dynamics)))}")
    say(f"after optimisation: {_counted(body.count())}")
    found = [_ours(dynamics, compiler, lanes, postures) for lanes in (LANES, 1)]
    found += [_limit(finished(body), compiler, lanes) for lanes in (LANES, 1)]
    for name, make in ((MUJOCO, mujoco_harness), (PINOCCHIO, pinocchio_harness)):
        try:
            found.append(_peer(name, make, robot, compiler, postures))
        except (ImportError, OSError, subprocess.CalledProcessError) as problem:
            say(f"{name} is left out: {str(problem).splitlines()[0]}")
    found.append(_casadi_map(dynamics, postures))
    times = interleaved({e.name: e.call for e in found}, rounds=rounds)
    return [
        Result(name=e.name, turns=1e9 * times[e.name] / COUNT, error=None, setup=e.setup,
               note=e.note)
        for e in found
    ]  # fmt: skip


def _terms(dynamics: RobotDynamics) -> ca.Function:
    return dynamics.rigid_body_terms


def _counted(count) -> str:
    return count._repr_markdown_()


def _programs(dynamics: RobotDynamics) -> tuple[StraightLine, StraightLine]:
    program = share_reciprocals(read_function(_terms(dynamics)), settled=["parameters"])
    return hoist_settled(program, ["parameters"])


def _postures(dynamics: RobotDynamics) -> _Postures:
    generator = np.random.default_rng(3)
    q = dynamics.description.home + generator.uniform(-0.3, 0.3, (COUNT, 5))
    qd, torque = generator.normal(size=(2, COUNT, 5))
    p = inertial_parameters(dynamics.description)
    rows = [_terms(dynamics)(q[i], qd[i], torque[i], p) for i in range(ROWS)]
    matrix, bias, _, _, qdd = (np.array([np.array(r[i]).T.ravel() for r in rows]) for i in range(5))
    return _Postures(q, qd, torque, {"matrix": matrix, "bias": bias, "qdd": qdd})


def _check(name: str, out: np.ndarray, truth: dict[str, np.ndarray]) -> None:
    """Fails unless M, V + G and q̈ are right."""
    parts = {"matrix": out[:, :25], "bias": out[:, 25:30], "qdd": out[:, 60:65]}
    for key, value in parts.items():
        scale = np.abs(truth[key]).max()
        # Products of rounding errors and the mass matrix's condition number, some 1e3.
        if not np.abs(value - truth[key]).max() <= 1e-9 * scale:
            raise OSError(f"{name} gives another {key}")


def _ours(dynamics, compiler: str, lanes: int, postures: _Postures) -> _Evaluator:
    def build():
        setup, body = _programs(dynamics)
        return compile_library(
            _SOURCE.format(
                support=support(lanes),
                setup=c_routine(setup, "setup", inputs=["parameters"]),
                body=c_routine(finished(body), "terms"),
                prepared=len(setup.output("prepared")),
            ),
            compiler,
        ).evaluate

    evaluate, seconds = timed(build)
    arrays = [_in_lanes(v, lanes) for v in (postures.q, postures.qd, postures.torque)]
    parameters = inertial_parameters(dynamics.description)
    wide = _in_lanes(np.repeat(parameters[None, :], lanes, axis=0), lanes)
    out = _in_lanes(np.zeros((ROWS, COLUMNS)), lanes)
    addresses = pointers(*arrays, wide, out)
    groups = COUNT // lanes
    name = OURS_LANES if lanes > 1 else OURS
    evaluate(ctypes.c_long(ROWS // lanes), *addresses)
    _check(name, out.transpose(0, 2, 1).reshape(ROWS, COLUMNS), postures.truth)
    return _Evaluator(name, lambda: evaluate(ctypes.c_long(groups), *addresses), seconds)


def _in_lanes(values: np.ndarray, lanes: int) -> np.ndarray:
    """(groups, columns, lanes)."""
    result = aligned((len(values) // lanes, values.shape[1], lanes))
    result[:] = values.reshape(-1, lanes, values.shape[1]).transpose(0, 2, 1)
    return result


def _limit(program: StraightLine, compiler: str, lanes: int) -> _Evaluator:
    work = compile_library(limit_source(program, lanes), compiler).work
    constants, results = np.array([1 + 1e-9, 1e-9]), aligned((CHAINS, lanes))
    addresses = pointers(constants, results)
    return _Evaluator(
        LIMIT_LANES if lanes > 1 else LIMIT,
        lambda: work(ctypes.c_long(COUNT // lanes), *addresses),
        0.0,
        "the same floating-point operations, independent, in registers",
    )


def _peer(
    name: str, make: Callable, robot: RobotDescription, compiler: str, postures: _Postures
) -> _Evaluator:
    evaluate, seconds = timed(lambda: make(robot, compiler))
    out = np.zeros((ROWS, COLUMNS))
    addresses = pointers(postures.q, postures.qd, postures.torque, out)
    evaluate(ctypes.c_long(ROWS), *addresses)
    _check(name, out, postures.truth)
    return _Evaluator(
        name, lambda: evaluate(ctypes.c_long(COUNT), *addresses), seconds, "called from C"
    )


def _casadi_map(dynamics: RobotDynamics, postures: _Postures) -> _Evaluator:
    mapped = _terms(dynamics).map(COUNT)
    inputs = [ca.DM(v.T) for v in (postures.q, postures.qd, postures.torque)]
    p = ca.repmat(ca.DM(inertial_parameters(dynamics.description)), 1, COUNT)
    return _Evaluator("CasADi's own machine, map", lambda: mapped(*inputs, p), 0.0)
