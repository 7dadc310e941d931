"""Certificates of the adaptive loop: known results, hostile simulation, and the other checker."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from flint import fmpq

from mrac_design.errors import ParameterError
from mrac_design.stability import Status, certified_loop
from mrac_design.stability.adaptive_loop import AdaptiveLoop, adaptive_loop, filter_step
from mrac_design.stability.certificate import StabilityCertificate, vertices_of
from mrac_design.stability.certification import certify, largest_box
from mrac_design.stability.claims import first_failure
from mrac_design.stability.design_map import design_map
from mrac_design.stability.exact_matrix import ldl_pivots, to_floats
from mrac_design.stability.inequalities import difference
from mrac_design.stability.parameter_box import projection_bounds, relative_box
from mrac_design.stability.sampled_loop import enclosed_exponential, sampling
from mrac_design.time_domain import Continuous
from mrac_design.verdict import Verdict
from tests.oracles.adaptive_axis import Axis

SOFT, STIFF = 800.0, 1200.0


def rst_loop(omega: int, K2: int, ao: int | None = None, b0: int = 800) -> AdaptiveLoop:
    """Loop with the gains of A R + b0 S = (p + ao)(p + ω)², in closed form; sampled at 1 kHz."""
    ao = omega if ao is None else ao
    r1 = 2 * omega + ao - K2
    gains = (r1 - ao, fmpq(2 * omega * ao + omega**2 - K2 * r1, b0), fmpq(ao * omega**2, b0))
    decay = np.exp(-ao * 1e-3)
    return adaptive_loop(
        design_stiffness=b0,
        velocity_gain=K2,
        bandwidth=omega,
        observer=(1, ao),
        internal_model=(1,),
        gains=gains,
        gain_scale=(omega, fmpq(omega**2, b0), fmpq(omega**3, b0)),
        filter_steps=[filter_step("1/1000", np.array([[decay]]), np.array([(1 - decay) / ao]))],
    )


@pytest.fixture(scope="module")
def continuous() -> StabilityCertificate:
    loop = rst_loop(500, 50)
    return certify(loop, relative_box(loop, "0.4", (800, 1200)), Continuous())


@pytest.fixture(scope="module")
def sampled() -> StabilityCertificate:
    loop = rst_loop(200, 50)
    return certify(loop, relative_box(loop, "0.2", (800, 1200)), sampling("1/1000", 1))


def test_the_published_continuous_design_is_certified_for_forty_percent(continuous) -> None:
    assert continuous.verdict is Verdict.PROVED
    assert continuous.verify() is None
    assert len(continuous.claims) == 4


def test_a_kilohertz_design_with_a_sample_of_delay_is_certified_for_twenty_percent(sampled) -> None:
    assert sampled.verdict is Verdict.PROVED
    assert sampled.verify() is None
    assert len(sampled.claims) == 3


def test_an_unstable_corner_refutes() -> None:
    loop = rst_loop(500, 50)
    refuted = certify(loop, relative_box(loop, "0.8", (800, 1200)), Continuous())
    assert refuted.verdict is Verdict.REFUTED
    assert "real part" in refuted.reason
    assert refuted.claims == ()
    slow = certify(loop, relative_box(loop, "0.2", (800, 1200)), sampling("1/1000", 1))
    assert slow.verdict is Verdict.REFUTED
    assert "modulus" in slow.reason


def test_a_tampered_claim_fails_the_exact_check(continuous) -> None:
    vertices = vertices_of(continuous.loop, continuous.box, continuous.timing)
    from mrac_design.stability.inequalities import derivative

    for claim in continuous.claims:
        P = claim.P.copy()
        P[0, 0] = -P[0, 0]
        broken = dataclasses.replace(claim, P=P)
        assert first_failure(broken, derivative, vertices) == "P is not positive definite"
    faster = dataclasses.replace(continuous.decay, rate=20 * continuous.decay.rate)
    assert "fails at the corner" in first_failure(faster, derivative, vertices)
    for name in ("energy", "peak", "mismatch"):
        claim = getattr(continuous, name)
        better = dataclasses.replace(claim, gain=claim.gain / 5)
        assert "fails at the corner" in first_failure(better, derivative, vertices)


def test_sampled_matrices_are_the_loop_in_si_units(sampled) -> None:
    """Twenty samples of the scaled matrices against the physical equations."""
    loop, box = sampled.loop, sampled.box
    vertex = vertices_of(loop, box, sampled.timing)[5]
    corner = list(box.corners())[5]
    omega, b0 = 200.0, 800.0
    scale = np.array([b0, b0 / omega, b0 / omega, omega])
    r, s0, s1, ratio = (int(v.p) / int(v.q) for v in corner)
    gains = np.array([r * omega, s0 * omega**2 / b0, s1 * omega**3 / b0])
    start = np.array([1e-3, -0.02, 0.1, 0.004])
    steps = 20
    _, end = Axis(K2=50.0, observer=(1.0, 200.0)).sampled_run(
        np.tile(gains, (steps, 1)), np.full(steps, ratio * b0), np.zeros((steps, 1)),
        1e-3, 1, start, 1,
    )  # fmt: skip
    state = np.array([*(scale * start), 0.0])
    for _ in range(steps):
        state = to_floats(vertex.A) @ state
    # Both sides are exact up to the rounding of twenty products.
    np.testing.assert_allclose(state[:4], scale * end, rtol=1e-10, atol=1e-13)


def extreme_gains(rng: np.random.Generator, nominal: np.ndarray, share: float, count: int):
    """Gains that jump between corners of the box, or wander inside it, held for random spans."""
    spread = rng.choice([-1.0, 1.0], size=(count, 3)) * (1 if rng.random() < 0.7 else rng.random())
    hold = rng.integers(1, 60)
    spread = np.repeat(spread[:: int(hold)], hold, axis=0)[:count]
    return nominal * (1 + share * spread)


def worst_response(step, output, count: int) -> float:
    """Adversary: disturbance sign per step that drives the final force highest, for each end."""
    best = 0.0
    for end in range(count // 2, count, 7):
        row = output(end)
        total = 0.0
        for k in range(end, -1, -1):
            transition, effect = step(k)
            total += abs(row @ effect)
            row = row @ transition
        best = max(best, total)
    return best


def test_hostile_continuous_paths_stay_below_the_peak_bound(continuous, record_property) -> None:
    rng = np.random.default_rng(3)
    axis = Axis(K2=50.0, observer=(1.0, 500.0))
    nominal = np.array([int(g.p) / int(g.q) for g in continuous.loop.gains])
    worst = 0.0
    for _ in range(12):
        gains = extreme_gains(rng, nominal, 0.4, 120)
        Ks = np.repeat(rng.uniform(SOFT, STIFF, 12), 10)
        steps = [axis.continuous_step(g, k, 5e-4) for g, k in zip(gains, Ks, strict=True)]
        rows = [np.array([k, 0.0, 0.0, 0.0]) for k in Ks]
        worst = max(worst, worst_response(steps.__getitem__, rows.__getitem__, len(steps)))
    record_property("bound over simulated peak", continuous.peak_gain / worst)
    assert worst <= continuous.peak_gain
    # A bound far above anything that happens would be no use: it must stay within a decade.
    assert continuous.peak_gain < 12 * worst


def test_hostile_sampled_paths_stay_below_the_peak_bound(sampled, record_property) -> None:
    """Random gain paths and bang-bang disturbances; the force is watched between samples too."""
    rng = np.random.default_rng(4)
    axis = Axis(K2=50.0, observer=(1.0, 200.0))
    nominal = np.array([int(g.p) / int(g.q) for g in sampled.loop.gains])
    worst, count, substeps = 0.0, 300, 4
    for trial in range(40):
        gains = extreme_gains(rng, nominal, 0.2, count)
        Ks = np.repeat(rng.uniform(SOFT, STIFF, count // 10), 10)
        hold = int(rng.integers(1, 120))
        signs = np.repeat(rng.choice([-1.0, 1.0], count * substeps // hold + 1), hold)
        d = (
            signs[: count * substeps].reshape(count, substeps)
            if trial
            else np.ones((count, substeps))
        )
        force, _ = axis.sampled_run(gains, Ks, d, 1e-3, 1, np.zeros(4), substeps)
        worst = max(worst, np.abs(force).max())
    record_property("bound over simulated peak", sampled.peak_gain / worst)
    assert worst <= sampled.peak_gain
    assert sampled.peak_gain < 20 * worst


def test_hostile_paths_stay_below_the_energy_bound(continuous, sampled) -> None:
    rng = np.random.default_rng(5)
    for certificate, omega, share in ((continuous, 500.0, 0.4), (sampled, 200.0, 0.2)):
        axis = Axis(K2=50.0, observer=(1.0, omega))
        nominal = np.array([int(g.p) / int(g.q) for g in certificate.loop.gains])
        for frequency in (0.0, 40.0, 120.0, 250.0):
            count, dt = 600, 1e-3
            gains = extreme_gains(rng, nominal, share, count)
            time = dt * np.arange(count)
            d = np.cos(frequency * time) * (time < 0.4)
            if certificate is sampled:
                force, _ = axis.sampled_run(
                    gains, np.full(count, STIFF), d[:, None], dt, 1, np.zeros(4), 1
                )
            else:
                x, force = np.zeros(4), []
                for g, w in zip(gains, d, strict=True):
                    transition, effect = axis.continuous_step(g, STIFF, dt)
                    x = transition @ x + effect * w
                    force.append(STIFF * x[0])
            gain = np.sqrt(np.square(force).sum() / np.square(d).sum())
            # The Riemann sum of the continuous force is within a few percent of its energy.
            assert gain <= certificate.energy_gain * (1.05 if certificate is continuous else 1)


def test_decay_holds_along_simulated_paths(sampled) -> None:
    P = to_floats(sampled.decay.P)
    rng = np.random.default_rng(6)
    vertices = [to_floats(v.A) for v in vertices_of(sampled.loop, sampled.box, sampled.timing)]
    for _ in range(50):
        x = rng.standard_normal(5)
        for _ in range(20):
            before = x @ P @ x
            x = vertices[rng.integers(len(vertices))] @ x
            # Proved exactly; the floats below only round.
            assert x @ P @ x <= (
                1 - float(int(sampled.decay.rate.p) / int(sampled.decay.rate.q))
            ) * before * (1 + 1e-9)


def test_the_largest_box_shrinks_with_delay_and_bandwidth() -> None:
    grid = design_map(
        [rst_loop(200, 20), rst_loop(400, 40)],
        [sampling("1/1000", 0), sampling("1/1000", 1), sampling("1/1000", 2)],
        (800, 1200),
        resolution="0.05",
    )
    values = np.nan_to_num(grid.fractions, nan=-1.0)
    assert np.all(np.diff(values, axis=0) <= 0)
    assert np.all(np.diff(values, axis=1) < 0)
    assert values[0, 1] >= 0.2
    assert "–" in grid._repr_markdown_()


def test_continuous_box_reaches_the_known_size() -> None:
    loop = rst_loop(500, 50)
    found = largest_box(loop, (800, 1200), Continuous(), resolution="0.02")
    assert found.proved
    assert fmpq(2, 5) <= found.fraction < fmpq(1, 2)


@pytest.mark.parametrize("x", [fmpq(1, 20), fmpq(1, 2), fmpq(7, 3), fmpq(40)])
def test_exponentials_are_enclosed(x) -> None:
    low, high = enclosed_exponential(x)
    value = np.exp(-int(x.p) / int(x.q))
    assert high - low < fmpq(1, 2**90)
    assert int(low.p) / int(low.q) == pytest.approx(value, rel=1e-12)


def test_projection_bounds_lie_inside_the_box(continuous) -> None:
    lower, upper = projection_bounds(continuous.loop, continuous.box)
    scale = continuous.loop.gain_scale
    for k in range(3):
        low, high = (fmpq(*float(side[k]).as_integer_ratio()) for side in (lower, upper))
        assert (
            continuous.box.lower[k] <= low / scale[k] <= high / scale[k] <= continuous.box.upper[k]
        )
    nominal = [int(g.p) / int(g.q) for g in continuous.loop.gains]
    np.testing.assert_allclose(lower, np.multiply(nominal, 0.6), rtol=1e-14)


def test_the_report_lists_what_the_certificate_still_assumes(sampled) -> None:
    coverage = certified_loop(sampled)
    status = {item.name: item.status for item in coverage.hypotheses}
    assert status["common Lyapunov function over the box"] is Status.PROVED
    assert status["sampling"] is Status.PROVED
    assert status["gains stay in the box"] is Status.ASSUMED
    assert coverage.verdict is Verdict.UNDECIDED
    assert "1000 Hz" in coverage._repr_markdown_()


def test_mismatched_inertia_below_the_bound_is_stable(continuous) -> None:
    """Three axes coupled by M⁻¹M̂ = 1 + Δ with random Δ at the tolerated norm, random corners."""
    rng = np.random.default_rng(8)
    bound = continuous.tolerated_mismatch
    assert 0.02 < bound < 1
    vertices = vertices_of(continuous.loop, continuous.box, continuous.timing)
    for _ in range(60):
        delta = rng.standard_normal((3, 3))
        delta *= bound / np.linalg.norm(delta, 2)
        picks = [vertices[k] for k in rng.integers(len(vertices), size=3)]
        A = np.zeros((12, 12))
        for i, vertex in enumerate(picks):
            A[4 * i : 4 * i + 4, 4 * i : 4 * i + 4] = to_floats(vertex.A)
            for k, other in enumerate(picks):
                A[4 * i + 1, 4 * k : 4 * k + 4] += (
                    delta[i, k] * to_floats(other.linearised_command)[0]
                )
        assert np.linalg.eigvals(A).real.max() < 0


def test_bad_numbers_are_refused() -> None:
    loop = rst_loop(500, 50)
    with pytest.raises(ParameterError, match="box fraction"):
        relative_box(loop, -1, (800, 1200))
    with pytest.raises(ParameterError, match="stiffness range"):
        relative_box(loop, "0.1", (1200, 800))
    with pytest.raises(ParameterError, match="delay"):
        sampling("1/1000", 7)
    with pytest.raises(ParameterError, match="resolution"):
        largest_box(loop, (800, 1200), Continuous(), resolution=2)


def test_ldl_pivots_of_a_known_matrix() -> None:
    matrix = np.array([[fmpq(4), fmpq(2)], [fmpq(2), fmpq(3)]], dtype=object)
    assert ldl_pivots(matrix) == (4, 2)
    with pytest.raises(ValueError, match="symmetric"):
        ldl_pivots(np.array([[fmpq(1), fmpq(2)], [fmpq(0), fmpq(1)]], dtype=object))


def test_difference_is_the_change_of_the_form() -> None:
    rng = np.random.default_rng(0)
    A, B, M = rng.standard_normal((3, 3)), rng.standard_normal((3, 1)), rng.standard_normal((3, 3))
    P, x, w = M + M.T, rng.standard_normal(3), rng.standard_normal(1)
    after = A @ x + B @ w
    joined = np.concatenate([x, w])
    form = joined @ difference(P, A, B) @ joined
    assert form == pytest.approx(after @ P @ after - x @ P @ x)
