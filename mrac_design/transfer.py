"""python-control's transfer functions, loaded when the first one is made.

Importing python-control takes about a second (it brings matplotlib's pyplot), which a simulation
or a design from the command line need not wait for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

if TYPE_CHECKING:
    import control


def transfer_function(
    numerator: ArrayLike, denominator: ArrayLike, dt: float = 0.0
) -> control.TransferFunction:
    """numerator/denominator, highest power first; `dt` in s, 0 for continuous time."""
    import control

    return control.TransferFunction(numerator, denominator, dt=dt)
