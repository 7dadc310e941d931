"""Counted joint positions and differenced velocities against their bounds."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrac_design.errors import ParameterError
from mrac_design.simulation.encoder import Encoder, ExactJoints
from tests.robot_steps import dynamics_of

PERIOD = 1e-3
ROBOT = dynamics_of("d2m2_set_a").description


def reader(encoder: Encoder):
    """The encoder as a numeric function (memory, q) → memory."""
    n = ROBOT.joint_count
    memory, q = encoder.memory(n).symbols("memory"), ca.SX.sym("q", n)
    values = {
        name: ca.SX(ca.DM(np.asarray(v))) for name, v in encoder.values(ROBOT, PERIOD).items()
    }
    seen = encoder.read(encoder.memory(n).split(memory), q, ca.SX.nan(n), values)
    function = ca.Function("read", [memory, q], [encoder.memory(n).join(seen.memory)])
    return lambda z, at: function(z, at).full().ravel()


def readings(encoder: Encoder, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities read sample by sample, from rest at the first position."""
    read, n = reader(encoder), ROBOT.joint_count
    memory = encoder.memory(n).pack(encoder.resting(positions[0], ROBOT))
    rows = []
    for position in positions:
        memory = read(memory, position)
        rows.append(memory)
    table = np.array(rows)
    return table[:, :n], table[:, n:]


def test_a_count_is_a_turn_through_the_transmission():
    encoder = Encoder(counts_per_turn=2.0**16, velocity_cutoff=500.0)
    turn = 2 * np.pi / 2**16
    # The pinion of the prismatic joint has a radius of 40 mm.
    np.testing.assert_allclose(encoder.resolution(ROBOT), turn * np.array([0.04, 1, 1, 1, 1]))


@given(bits=st.integers(8, 24), q=st.lists(st.floats(-3, 3), min_size=5, max_size=5))
def test_positions_are_the_nearest_count(bits, q):
    encoder = Encoder(counts_per_turn=2.0**bits, velocity_cutoff=500.0)
    resolution = encoder.resolution(ROBOT)
    counted, _ = readings(encoder, np.array([q]))
    # Half a count, and the rounding of a division of numbers up to 3.
    assert np.all(np.abs(counted[0] - q) <= resolution / 2 + 1e-15)
    steps = counted[0] / resolution
    np.testing.assert_allclose(steps, np.round(steps), rtol=1e-12)


@pytest.mark.parametrize("cutoff", [200.0, 1000.0, 5000.0])
def test_velocity_is_the_filtered_difference_within_its_bound(cutoff):
    """Quantisation adds at most share × resolution / h to what exact positions would give."""
    rng = np.random.default_rng(2)
    t = PERIOD * np.arange(400)[:, None]
    true = ROBOT.home + 0.02 * np.sin(2 * np.pi * rng.uniform(0.5, 3, 5) * t + rng.uniform(0, 6, 5))
    coarse = Encoder(counts_per_turn=2.0**14, velocity_cutoff=cutoff)
    _, velocity = readings(coarse, true)
    share = 1 - np.exp(-cutoff * PERIOD)
    exact = np.zeros_like(true)
    for k in range(1, t.size):
        exact[k] = exact[k - 1] + share * ((true[k] - true[k - 1]) / PERIOD - exact[k - 1])
    error = np.abs(velocity - exact)
    bound = share * coarse.resolution(ROBOT) / PERIOD
    assert np.all(error <= bound * (1 + 1e-9))
    assert np.all(error.max(axis=0) > 0.3 * bound)  # the bound is not idle


def test_velocity_lags_a_ramp_as_documented():
    """A steady acceleration shows h/2 of the difference and h/(e^{ωc h} − 1) of the filter."""
    cutoff, acceleration = 300.0, 2.0
    t = PERIOD * np.arange(200)[:, None]
    true = ROBOT.home + acceleration * t**2 / 2
    _, velocity = readings(Encoder(counts_per_turn=2.0**40, velocity_cutoff=cutoff), true)
    lag = t[-1] - velocity[-1] / acceleration
    np.testing.assert_allclose(
        lag, PERIOD / 2 + PERIOD / np.expm1(cutoff * PERIOD), rtol=1e-3
    )  # the start has died out, and 2⁻⁴⁰ of a turn is hardly a step


def test_exact_joints_pass_everything_on():
    q, qd = ca.SX.sym("q", 5), ca.SX.sym("qd", 5)
    seen = ExactJoints().read({}, q, qd, {})
    assert seen.position is q
    assert seen.velocity is qd
    assert ExactJoints().memory(5).size == 0


@pytest.mark.parametrize(
    ("changes", "word"),
    [({"counts_per_turn": 0.0}, "counts"), ({"velocity_cutoff": 0.0}, "cutoff")],
)
def test_bad_choices_are_named(changes, word):
    with pytest.raises(ParameterError, match=word):
        Encoder(**{"counts_per_turn": 4096.0, "velocity_cutoff": 500.0} | changes)
