"""Polynomials and the Diophantine equation in `fractions.Fraction`, lists highest power first.

Written to be obviously right rather than fast: convolution, Gaussian elimination, and the
closed forms found by comparing coefficients by hand.
"""

from __future__ import annotations

from fractions import Fraction


def fractions(values):
    return [Fraction(value) for value in values]


def product(*factors):
    total = [Fraction(1)]
    for factor in factors:
        result = [Fraction(0)] * (len(total) + len(factor) - 1)
        for i, a in enumerate(total):
            for j, b in enumerate(factor):
                result[i + j] += a * b
        total = result
    return total


def add(left, right):
    size = max(len(left), len(right))
    left = [Fraction(0)] * (size - len(left)) + list(left)
    right = [Fraction(0)] * (size - len(right)) + list(right)
    return [a + b for a, b in zip(left, right, strict=True)]


def trimmed(polynomial):
    start = next((i for i, value in enumerate(polynomial) if value != 0), len(polynomial))
    return polynomial[start:]


def solve(A, B, C):
    """X, Y with A X + B Y = C and deg Y < deg A, None when the equations are singular."""
    n = len(A) - 1
    degree_X = max(len(C) - 1 - n, len(B) - 2, 0)
    size = degree_X + n + 1
    columns = []
    for polynomial, degree in ((A, degree_X), (B, n - 1)):
        for power in range(degree, -1, -1):
            shifted = list(polynomial) + [Fraction(0)] * power
            columns.append([Fraction(0)] * (size - len(shifted)) + shifted)
    right = [Fraction(0)] * (size - len(C)) + list(C)
    rows = [[column[i] for column in columns] + [right[i]] for i in range(size)]
    for k in range(size):
        pivot = next((i for i in range(k, size) if rows[i][k] != 0), None)
        if pivot is None:
            return None
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(size):
            if i != k and rows[i][k] != 0:
                factor = rows[i][k] / rows[k][k]
                rows[i] = [a - factor * b for a, b in zip(rows[i], rows[k], strict=True)]
    unknowns = [rows[k][-1] / rows[k][k] for k in range(size)]
    return unknowns[: degree_X + 1], unknowns[degree_X + 1 :]


def force_rst(K2, b0, omega, xi, ao):
    """r1, s0, s1, t0, t1 of p(p + K2) R + b0 S = (p + ao)(p² + 2ξωp + ω²), T = (ω²/b0) Ao."""
    r1 = 2 * xi * omega + ao - K2
    s0 = (2 * xi * omega * ao + omega**2 - K2 * r1) / b0
    s1 = ao * omega**2 / b0
    return [r1, s0, s1, omega**2 / b0, ao * omega**2 / b0]


def force_rst_with_integrator(K2, b0, omega, xi, alpha1, alpha2):
    """r1, s0, s1, s2 with R = p(p + r1) and Ao = p² + α1 p + α2."""
    r1 = alpha1 + 2 * xi * omega - K2
    s0 = (alpha2 + 2 * xi * omega * alpha1 + omega**2 - K2 * r1) / b0
    s1 = (2 * xi * omega * alpha2 + alpha1 * omega**2) / b0
    return [r1, s0, s1, alpha2 * omega**2 / b0]
