"""Verner's method of order 7 in nine stages.

Where steps end on every record, it does with a quarter fewer evaluations than Dormand and Prince's
of order 8 what is wanted more often than that one's 1e-10. Coefficients: J. H. Verner 2010,
Numerically optimal Runge–Kutta pairs with interpolants, the "most efficient" pair of orders 7(6).
"""

from __future__ import annotations

import numpy as np

from mrac_design.simulation.tableau import ButcherTableau

_ROWS: tuple[tuple[float, ...], ...] = (
    (),
    (0.005,),
    (-1.0767901234567901235, 1.1856790123456790123),
    (0.040833333333333333333, 0, 0.1225),
    (0.63891392362557267805, 0, -2.4556726382236568097, 2.2722587145980841316),
    (
        -2.6615773750187571311, 0, 10.804513886456137696, -8.3539146573961994120,
        0.82048759495665697914,
    ),
    (
        6.0677414346967709927, 0, -24.711273635911085797, 20.427517930788893940,
        -1.9061579788166471506, 1.0061722492420680148,
    ),
    (
        12.054670076253202995, 0, -49.754784950468989328, 41.142888638604676633,
        -4.4617601499740041856, 2.0423348222391749598, -0.098348436654061073795,
    ),
    (
        10.138146522881807876, 0, -42.641136031717502146, 35.763840039922570071,
        -4.3480228403929076533, 2.0098622683770358954, 0.34874904603382724060,
        -0.27143900510483128424,
    ),
)  # fmt: skip

VERNER_7 = ButcherTableau(
    name="Verner 7",
    order=7,
    a=np.array([(*row, *[0.0] * (9 - len(row))) for row in _ROWS]),
    b=np.array(
        [
            0.047155618486272221704, 0, 0, 0.25750564298434151896, 0.26216653977412620477,
            0.15216092656738557403, 0.49399691700324842469, -0.29430311714032504416,
            0.081317472324951099997,
        ]
    ),
)  # fmt: skip
