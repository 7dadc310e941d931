from __future__ import annotations

import numpy as np
import pytest

from mrac_design.tuning.search import SearchEnd, least_largest, scattered


class Hill:
    """Three errors with a kink between them and one slack; remembers the best admissible."""

    def __init__(self, wall: float, budget: int = 10_000):
        self.wall, self.budget, self.tried, self.best = wall, budget, 0, (np.inf, None)

    def __call__(self, x):
        if self.tried >= self.budget:
            raise SearchEnd
        self.tried += 1
        errors = np.array([(x[0] - 0.9) ** 2 + x[1], (x[0] - 0.1) ** 2 + x[1], 1.0 - x[1]])
        slack = self.wall - x[0] - x[1]
        if slack >= 0 and errors.max() < self.best[0]:
            self.best = errors.max(), x.copy()
        return errors, np.array([slack])


def test_meets_the_kink():
    hill = Hill(wall=5.0)
    least_largest(hill, [np.array([0.2, 0.9])])
    # By symmetry x0 = 1/2; there 0.16 + x1 = 1 - x1.
    assert hill.best[0] == pytest.approx(0.58, abs=1e-3)
    assert hill.best[1] == pytest.approx([0.5, 0.42], abs=0.02)
    assert hill.tried < 60


def test_meets_the_corner_of_kink_and_constraint():
    hill = Hill(wall=0.7)
    least_largest(hill, [np.array([0.2, 0.9])])
    # Left of the kink (x0 - 0.9)² + x1 decides against 1 - x1, with x0 + x1 = 0.7 binding.
    x0 = np.roots([1.0, -3.8, 1.21])
    x0 = float(x0[(x0 > 0) & (x0 < 0.5)][0])
    assert hill.best[1] == pytest.approx([x0, 0.7 - x0], abs=5e-3)
    assert hill.tried < 60


def test_ends_when_the_evaluation_says_so():
    hill = Hill(wall=5.0, budget=7)
    least_largest(hill, [np.array([0.2, 0.9])] * 3)
    assert hill.tried == 7


def test_points_are_the_corners_and_the_same_for_a_seed():
    points = scattered(3, count=10, seed=4)
    assert points.shape == (18, 3)
    assert {tuple(p) for p in points[:8]} == {
        (a, b, c) for a in (0, 1) for b in (0, 1) for c in (0, 1)
    }
    assert np.array_equal(points, scattered(3, count=10, seed=4))
    assert not np.array_equal(points, scattered(3, count=10, seed=5))
