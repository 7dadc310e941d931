from __future__ import annotations

import math

import control
import numpy as np
import pytest

from mrac_design.design import stability_margins
from mrac_design.errors import ParameterError
from mrac_design.polynomials import coefficients, exact_polynomial
from mrac_design.time_domain import Continuous, Discrete


def poly(*values):
    return exact_polynomial(values)


def test_third_order_lag_has_gain_margin_eight():
    """L = 1/(p + 1)³: phase −180° at √3 where |L| = 1/8; no gain crossover but at 0."""
    margins = stability_margins(poly(1), poly(1, 1) ** 3, Continuous())
    assert margins.gain_margin == pytest.approx(8.0, rel=1e-14)
    assert margins.gain_reduction_margin == 0.0
    assert margins.phase_margin == math.inf


def test_integrator_with_lag():
    """L = 1/(p(p + 1)): ω² = (√5 − 1)/2, phase margin 90° − atan ω."""
    margins = stability_margins(poly(1), poly(1, 1, 0), Continuous())
    crossover = math.sqrt((math.sqrt(5.0) - 1.0) / 2.0)
    assert margins.crossover_frequency == pytest.approx(crossover, rel=1e-14)
    assert margins.phase_margin == pytest.approx(math.pi / 2 - math.atan(crossover), rel=1e-14)
    assert margins.delay_margin == pytest.approx(margins.phase_margin / crossover, rel=1e-14)
    assert margins.gain_margin == math.inf


def test_conditionally_stable_loop_has_two_gain_limits():
    """L = k (p + 1)²/p³ is stable for k > 1/2 only."""
    margins = stability_margins(poly(2, 4, 2), poly(1, 0, 0, 0), Continuous())
    assert margins.gain_reduction_margin == pytest.approx(0.25, rel=1e-14)
    assert margins.gain_margin == math.inf


def test_discrete_integrator():
    """L = k/(q − 1) is stable for k < 2; here k = 1, and −1 is at q = −1."""
    margins = stability_margins(poly(1), poly(1, -1), Discrete(0.1))
    assert margins.gain_margin == pytest.approx(2.0, rel=1e-14)
    assert margins.modulus_margin == pytest.approx(0.5, rel=1e-14)
    # |e^{jx} − 1| = 1 at x = π/3, where the phase is −π/2 − π/6.
    assert margins.crossover_frequency == pytest.approx(math.pi / 3 / 0.1, rel=1e-13)
    assert margins.phase_margin == pytest.approx(math.pi / 3, rel=1e-13)
    # One whole sample of delay: (q − 1) q + 1 has its roots on the circle.
    assert margins.delay_margin == pytest.approx(0.1, rel=1e-13)


@pytest.mark.parametrize("domain", [Continuous(), Discrete(0.2)])
def test_random_loops_against_python_control_and_a_grid(domain):
    rng = np.random.default_rng(5)
    checked = 0
    while checked < 25:
        order = rng.integers(1, 5)
        if domain.static_point == 0:
            denominator = np.real(np.poly(-rng.uniform(0.05, 5.0, order)))
            grid = np.logspace(-4, 4, 40001)
            points = 1j * grid
        else:
            denominator = np.real(np.poly(rng.uniform(-0.9, 0.98, order)))
            grid = np.linspace(1e-6, np.pi / 0.2, 40001)
            points = np.exp(1j * grid * 0.2)
        numerator = rng.normal(size=rng.integers(1, order + 1)) * 2.0
        N, D = poly(*numerator.tolist()), poly(*denominator.tolist())
        try:
            margins = stability_margins(N, D, domain)
        except ParameterError:
            continue
        checked += 1
        L = np.polyval(coefficients(N), points) / np.polyval(coefficients(D), points)
        # A grid minimum is above the true one, by the grid's step at most.
        nearest = np.abs(1.0 + L).min()
        assert margins.modulus_margin <= nearest * (1 + 1e-12)
        assert margins.modulus_margin == pytest.approx(nearest, rel=1e-4)
        system = control.tf(coefficients(N), coefficients(D), dt=domain.dt)
        gains, phases, _, _, crossovers, _ = control.stability_margins(system, returnall=True)
        # python-control also lists the limit at frequency 0, and gains of loops that it leaves
        # out at infinity; compare what is finite on both sides.
        above = gains[(gains > 1.0) & np.isfinite(gains)]
        if above.size and math.isfinite(margins.gain_margin):
            assert margins.gain_margin <= above.min() * (1 + 1e-6)
        crossovers, phases = crossovers[crossovers > 1e-6], phases[crossovers > 1e-6]
        if crossovers.size:
            lags = np.radians(phases) % (2.0 * np.pi)
            assert margins.crossover_frequency == pytest.approx(crossovers.max(), rel=1e-6)
            assert margins.delay_margin == pytest.approx((lags / crossovers).min(), rel=1e-6)


def test_gain_margins_are_where_stability_ends():
    """An independent meaning: just inside the limits the loop is stable, just outside not."""
    rng = np.random.default_rng(6)
    checked = 0
    while checked < 40:
        order = rng.integers(2, 6)
        N = np.real(np.poly(-rng.uniform(0.1, 4.0, rng.integers(1, order))))
        N = N * rng.uniform(0.5, 20.0)
        D = np.real(np.poly(-rng.uniform(-0.5, 4.0, order)))
        if np.roots(np.polyadd(N, D)).real.max() >= -1e-3:
            continue
        margins = stability_margins(poly(*N.tolist()), poly(*D.tolist()), Continuous())
        limits = (margins.gain_margin, margins.gain_reduction_margin)
        if limits == (math.inf, 0.0):
            continue
        checked += 1
        for limit, inward in zip(limits, (1 - 1e-6, 1 + 1e-6), strict=True):
            if 0.0 < limit < math.inf:
                assert np.roots(np.polyadd(limit * inward * N, D)).real.max() < 0.0
                assert np.roots(np.polyadd(limit / inward * N, D)).real.max() > 0.0


def test_unstable_loop_has_no_margins():
    with pytest.raises(ParameterError, match="stable loop only"):
        stability_margins(poly(9), poly(1, 1) ** 3, Continuous())
