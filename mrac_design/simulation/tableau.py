"""Explicit Runge–Kutta methods as values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrac_design.arrays import FloatArray, readonly


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ButcherTableau:
    """Coefficients of an explicit Runge–Kutta method; consistency is checked on construction."""

    name: str
    """Name shown to people."""
    order: int
    """Order of the global error in the step."""
    a: FloatArray
    """Stage weights, strictly lower triangular, shape (stages, stages)."""
    b: FloatArray
    """Weights of the step, shape (stages,)."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "b", readonly(self.b, (-1,)))
        object.__setattr__(self, "a", readonly(self.a, (self.stages, self.stages)))
        assert not np.triu(self.a).any(), "an explicit method is strictly lower triangular"
        # The quadrature conditions: b integrates polynomials of degree < order exactly.
        for power in range(self.order):
            assert abs(self.b @ self.c**power - 1 / (power + 1)) < 1e-13, (self.name, power)

    @property
    def stages(self) -> int:
        """Number of evaluations of the right-hand side in a step."""
        return int(self.b.size)

    @property
    def c(self) -> FloatArray:
        """Instants of the stages as fractions of the step (row sums of a), shape (stages,)."""
        return readonly(self.a.sum(axis=1))


RK4 = ButcherTableau(
    name="classical Runge–Kutta",
    order=4,
    a=np.array([[0, 0, 0, 0], [1 / 2, 0, 0, 0], [0, 1 / 2, 0, 0], [0, 0, 1, 0]]),
    b=np.array([1 / 6, 1 / 3, 1 / 3, 1 / 6]),
)

DORMAND_PRINCE_5 = ButcherTableau(
    name="Dormand–Prince",
    order=5,
    a=np.array(
        [
            [0, 0, 0, 0, 0, 0],
            [1 / 5, 0, 0, 0, 0, 0],
            [3 / 40, 9 / 40, 0, 0, 0, 0],
            [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
            [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
            [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
        ]
    ),
    b=np.array([35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]),
)


def _padded(rows: list[list[float]]) -> FloatArray:
    """A square matrix from rows that leave out their zeros at the end."""
    matrix = np.zeros((len(rows), len(rows)))
    for line, row in zip(matrix, rows, strict=True):
        line[: len(row)] = row
    return matrix


# Hairer, Nørsett and Wanner 1993, code DOP853: twelve stages, order 8.
DORMAND_PRINCE_8 = ButcherTableau(
    name="Dormand–Prince 8",
    order=8,
    a=_padded(
        [
            [],
            [0.05260015195876773],
            [0.0197250569845379, 0.0591751709536137],
            [0.02958758547680685, 0, 0.08876275643042054],
            [0.2413651341592667, 0, -0.8845494793282861, 0.924834003261792],
            [0.037037037037037035, 0, 0, 0.17082860872947386, 0.12546768756682242],
            [0.037109375, 0, 0, 0.17025221101954405, 0.06021653898045596, -0.017578125],
            [
                0.03709200011850479,
                0,
                0,
                0.17038392571223998,
                0.10726203044637328,
                -0.015319437748624402,
                0.008273789163814023,
            ],
            [
                0.6241109587160757,
                0,
                0,
                -3.3608926294469414,
                -0.868219346841726,
                27.59209969944671,
                20.154067550477894,
                -43.48988418106996,
            ],
            [
                0.47766253643826434,
                0,
                0,
                -2.4881146199716677,
                -0.590290826836843,
                21.230051448181193,
                15.279233632882423,
                -33.28821096898486,
                -0.020331201708508627,
            ],
            [
                -0.9371424300859873,
                0,
                0,
                5.186372428844064,
                1.0914373489967295,
                -8.149787010746927,
                -18.52006565999696,
                22.739487099350505,
                2.4936055526796523,
                -3.0467644718982196,
            ],
            [
                2.273310147516538,
                0,
                0,
                -10.53449546673725,
                -2.0008720582248625,
                -17.9589318631188,
                27.94888452941996,
                -2.8589982771350235,
                -8.87285693353063,
                12.360567175794303,
                0.6433927460157636,
            ],
        ]
    ),
    b=np.array(
        [
            0.054293734116568765,
            0,
            0,
            0,
            0,
            4.450312892752409,
            1.8915178993145003,
            -5.801203960010585,
            0.3111643669578199,
            -0.1521609496625161,
            0.20136540080403034,
            0.04471061572777259,
        ]
    ),
)
