"""The rate of a system in C with the copies in it side by side."""

from __future__ import annotations

from collections.abc import Iterator

from mrac_design.codegen.c_source import c_routine
from mrac_design.codegen.packed_source import PACKS, packed_routine
from mrac_design.codegen.packing import WIDTH, Lanes, pack
from mrac_design.codegen.straight_line import StraightLine
from mrac_design.layout import Layout


def rate_text(
    state: Layout, setup: StraightLine, body: StraightLine, lanes: int
) -> tuple[StraightLine, str]:
    """Setup and C text of the function `rate`, which computes `body`.

    Where a vector does not hold several runs already, copies go side by side in one: three or
    four blocks of the state in a row of the same length, such as the controllers of the axes,
    are taken for such. Where they are none, little is joined and nothing changes its value.
    """
    if lanes > 1:
        return setup, c_routine(body, "rate")
    entries = body.output("rate")
    copies = [tuple(entries[i] for i in places) for places in _copied_entries(state)]
    setup, packed = pack(setup, body, copies, settled=("p", "prepared"))
    return setup, PACKS + packed_routine(packed, "rate")


def _copied_entries(state: Layout) -> Iterator[Lanes]:
    blocks, first, done = state.blocks, 0, 0
    while done < len(blocks):
        size = blocks[done][1]
        count = 1
        for _, other in blocks[done + 1 : done + WIDTH]:
            if other != size:
                break
            count += 1
        if count > 2:
            for i in range(first, first + size):
                yield tuple(range(i, i + count * size, size))
        first += count * size
        done += count
