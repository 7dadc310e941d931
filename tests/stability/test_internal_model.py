"""Loops whose controller contains a model of the motion: matrices, boxes, hostile gain paths."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from flint import fmpq, fmpq_mat, fmpq_poly

from mrac_design.errors import ParameterError
from mrac_design.stability.adaptive_loop import adaptive_loop, filter_step
from mrac_design.stability.certificate import vertices_of
from mrac_design.stability.certification import certify, has_common_lyapunov_function
from mrac_design.stability.claims import DecayClaim
from mrac_design.stability.exact_matrix import to_floats
from mrac_design.stability.instability import _proved_unstable
from mrac_design.stability.parameter_box import ParameterBox, projection_bounds, relative_box
from mrac_design.stability.rational_function import to_float
from mrac_design.stability.sampled_loop import sampling
from mrac_design.time_domain import Continuous
from mrac_design.verdict import Verdict
from tests.stability.internal_models import HEART_BAND, INTEGRATOR, PERIOD, Placed

TISSUE = (800, 1200)


def scaling(case: Placed, delay: int) -> np.ndarray:
    """Scaled state over SI state."""
    omega, command = case.bandwidth, case.b0 / case.bandwidth**2
    chain = omega ** np.arange(1.0, len(case.observer))
    return np.array([case.b0, case.b0 / omega, *command * chain, *chain, *[command] * delay])


def corners_in_si(case: Placed, box: ParameterBox):
    """(r1', s0, …, sn) and Ks of every corner."""
    units = [*case.loop.gain_scale, case.loop.design_stiffness]
    for corner in box.corners():
        values = np.array([to_float(v * d) for v, d in zip(corner, units, strict=True)])
        yield values[:-1], values[-1]


@pytest.mark.parametrize("case", [INTEGRATOR, HEART_BAND])
def test_continuous_matrices_are_those_of_the_transfer_functions(case) -> None:
    box = relative_box(case.loop, "0.2", (400, 1500))
    scale = scaling(case, 0)
    vertices = vertices_of(case.loop, box, Continuous())
    assert len(vertices) == 2 ** (len(case.observer) + 2)
    for vertex, (gains, Ks) in zip(vertices, corners_in_si(case, box), strict=True):
        wanted = case.axis.continuous_matrix(gains, Ks) * scale[:, None] / scale / case.bandwidth
        # A dozen roundings of entries up to a few tens.
        np.testing.assert_allclose(to_floats(vertex.A), wanted, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("case", [INTEGRATOR, HEART_BAND])
@pytest.mark.parametrize("delay", [0, 1, 3])
def test_sampled_matrices_are_one_step_of_the_oracle(case, delay) -> None:
    box = relative_box(case.loop, "0.2", (400, 1500))
    scale = scaling(case, delay)
    vertices = vertices_of(case.loop, box, sampling("1/1000", delay))
    states = np.eye(len(scale))
    own = len(scale) - delay
    for vertex, (gains, Ks) in list(zip(vertices, corners_in_si(case, box), strict=False))[::7]:
        columns = []
        for state in states / scale:
            _, end = case.axis.sampled_run(
                gains[None], [Ks], np.zeros((1, 1)), PERIOD, delay, state[:own], 1,
                waiting=state[own:][::-1],
            )  # fmt: skip
            columns.append(np.concatenate([end[:own], end[own:][::-1]]) * scale)
        # The oracle's exponential of the plant and the enclosed one differ by rounding only.
        np.testing.assert_allclose(
            to_floats(vertex.A), np.transpose(columns), rtol=1e-12, atol=1e-13
        )


@pytest.mark.parametrize("case", [INTEGRATOR, HEART_BAND])
def test_nominal_poles_are_those_placed_and_the_observers(case) -> None:
    """The characteristic polynomial is Ao · Ao Am: the filters of u and y repeat the observer."""
    box = relative_box(case.loop, 0, (case.b0, case.b0))
    (vertex,) = vertices_of(case.loop, box, Continuous())
    found = fmpq_mat(vertex.A.tolist()).charpoly()
    omega = case.loop.bandwidth

    def scaled(polynomial):
        exact = [fmpq(*float(v).as_integer_ratio()) for v in polynomial]
        return fmpq_poly([v / omega**k for k, v in enumerate(exact)][::-1])

    wanted = scaled(case.observer) * scaled(case.poles)
    for k in range(found.degree() + 1):
        # The gains are floats: a few roundings, relative to the sum of a coefficient's terms.
        assert to_float(found[k]) == pytest.approx(to_float(wanted[k]), rel=1e-11, abs=1e-14)


def test_the_heart_band_is_certified_over_soft_and_stiff_tissue() -> None:
    loop, timing = HEART_BAND.loop, sampling("1/1000", 1)
    assert has_common_lyapunov_function(loop, relative_box(loop, "0.05", TISSUE), timing)
    assert has_common_lyapunov_function(loop, relative_box(loop, "0.02", (400, 1500)), timing)
    # r1' is what sampling limits: held close, the others may move twice as far.
    shares = ("0.03", *["0.1"] * 4)
    assert has_common_lyapunov_function(loop, relative_box(loop, shares, TISSUE), timing)


@pytest.mark.parametrize(("case", "share"), [(INTEGRATOR, "0.9"), (HEART_BAND, "0.08")])
def test_a_sampled_corner_that_grows_refutes(case, share) -> None:
    """With K2 > 0 the proof covers the whole enclosure of the exponential."""
    refuted = certify(case.loop, relative_box(case.loop, share, TISSUE), sampling("1/1000", 1))
    assert refuted.verdict is Verdict.REFUTED
    assert "modulus" in refuted.reason
    gains = list(corners_in_si(case, refuted.box))
    worst = 0.0
    for values, Ks in gains:
        step = vertices_matrix(case, values, Ks)
        worst = max(worst, float(np.abs(np.linalg.eigvals(step)).max()))
    assert worst > 1


def test_what_is_stable_is_never_refuted() -> None:
    """Every frozen corner is stable, but no common Lyapunov function is found: undecided."""
    loop, timing = HEART_BAND.loop, sampling("1/1000", 1)
    box = relative_box(loop, "0.065", TISSUE)
    certificate = certify(loop, box, timing)
    assert certificate.verdict is Verdict.UNDECIDED
    assert "smaller" in certificate.reason
    vertices = vertices_of(loop, box, timing)
    assert not any(_proved_unstable([vertex]) for vertex in vertices[::5])


def vertices_matrix(case: Placed, gains: np.ndarray, Ks: float) -> np.ndarray:
    """One sample of the oracle with a delay of one, frozen gains, in scaled coordinates."""
    scale = scaling(case, 1)
    own = len(scale) - 1
    columns = []
    for state in np.eye(len(scale)) / scale:
        _, end = case.axis.sampled_run(
            gains[None], [Ks], np.zeros((1, 1)), PERIOD, 1, state[:own], 1, waiting=state[own:]
        )
        columns.append(end * scale)
    return np.transpose(columns)


@pytest.fixture(scope="module")
def proved():
    case = dataclasses.replace(INTEGRATOR, K2=0.0)
    loop = case.loop
    return case, certify(loop, relative_box(loop, "0.05", TISSUE), sampling("1/1000", 1))


def test_every_claim_is_proved(proved) -> None:
    _, certificate = proved
    assert certificate.verdict is Verdict.PROVED
    assert certificate.verify() is None
    assert len(certificate.claims) == 3


def test_lyapunov_function_falls_along_random_gain_paths(proved) -> None:
    """The oracle runs in SI units from random states, gains anywhere in the box at each sample."""
    case, certificate = proved
    rng = np.random.default_rng(1)
    scale = scaling(case, 1)
    claim = certificate.decay
    assert isinstance(claim, DecayClaim)
    P, rate = to_floats(claim.P), to_float(claim.rate)
    lower, upper = projection_bounds(case.loop, certificate.box)
    for _ in range(20):
        state = rng.standard_normal(len(scale)) / scale
        for _ in range(30):
            before = (scale * state) @ P @ (scale * state)
            where = rng.integers(2, size=len(lower)) if rng.random() < 0.7 else rng.random()
            gains = lower + (upper - lower) * where
            _, state = case.axis.sampled_run(
                gains[None], [rng.uniform(*TISSUE)], np.zeros((1, 1)), PERIOD, 1, state[:-1], 1,
                waiting=state[-1:],
            )  # fmt: skip
            after = (scale * state) @ P @ (scale * state)
            assert after <= (1 - rate) * before * (1 + 1e-9)


def test_hostile_force_stays_below_the_peak_bound(proved) -> None:
    case, certificate = proved
    rng = np.random.default_rng(2)
    lower, upper = projection_bounds(case.loop, certificate.box)
    worst = 0.0
    for _ in range(12):
        count = 400
        hold = int(rng.integers(1, 120))
        signs = np.repeat(rng.choice([-1.0, 1.0], count // hold + 1), hold)[:count]
        gains = lower + (upper - lower) * np.repeat(
            rng.integers(2, size=(count // 20, len(lower))), 20, axis=0
        )
        Ks = np.repeat(rng.uniform(*TISSUE, count // 20), 20)
        force, _ = case.axis.sampled_run(
            gains, Ks, np.tile(signs[:, None], (1, 3)), PERIOD, 1, np.zeros(6), 3
        )
        worst = max(worst, np.abs(force).max())
    assert worst <= certificate.peak_gain
    # Bang-bang of random length is hostile enough to come within a decade.
    assert certificate.peak_gain < 10 * worst


def test_bad_loops_and_boxes_are_refused() -> None:
    good = HEART_BAND.loop
    numbers = {
        "design_stiffness": good.design_stiffness,
        "velocity_gain": good.velocity_gain,
        "bandwidth": good.bandwidth,
        "observer": good.observer,
        "internal_model": good.internal_model,
        "gains": good.gains,
        "gain_scale": good.gain_scale,
        "filter_steps": good.filter_steps,
    }
    for change, message in (
        ({"observer": (2, 1, 1, 1)}, "begin with 1"),
        ({"internal_model": (1, 0)}, "one degree more"),
        ({"gains": (1, 2, 3)}, "5 gains"),
        ({"gain_scale": (1, 1, 1, 1, 0)}, "> 0"),
        ({"filter_steps": INTEGRATOR.loop.filter_steps}, "3 states"),
    ):
        with pytest.raises(ParameterError, match=message):
            adaptive_loop(**(numbers | change))
    with pytest.raises(ParameterError, match="no filter step"):
        vertices_of(good, relative_box(good, 0, (800, 800)), sampling("1/2000", 1))
    with pytest.raises(ParameterError, match="2 × 2"):
        filter_step("1/1000", np.eye(3), np.ones(2))
    with pytest.raises(ParameterError, match="5 gains"):
        relative_box(good, ("0.1", "0.1"), TISSUE)
