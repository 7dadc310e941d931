"""Locating events inside integration steps: the decisions, as straight-line programs.

An attempt of a step that ends with another sign of an event function is repeated with other
lengths until the change lies between two of them that are a tolerance apart. The lengths come from
the Illinois variant of false position (Dowell & Jarratt 1971) on every function that has changed,
the smallest first; bisection takes over if that is slow. The step then ends just past the change.

All machines run these programs, lanes included, so all make the same decisions.
"""

from __future__ import annotations

import casadi as ca

from mrac_design.codegen.reading import call_program, read_function
from mrac_design.codegen.straight_line import Builder, StraightLine
from mrac_design.layout import Layout

TOLERANCE = 2.0**-36
"""Width to which a change is bracketed, as a share of the whole step."""
EVENTS_PER_STEP = 32
"""Events that end an attempt within one step; a run with more is given up."""
TURNS_AT_ONE_INSTANT = 4
"""Times modes are looked at again after changing, should one change make another."""
_PATIENCE = 16
"""Attempts before bisection takes over."""
_MOST_ATTEMPTS = _PATIENCE + 40
"""Attempts of one search, more than bisection from the whole step to the tolerance takes."""


def registers(events: int) -> Layout:
    """Numbers that describe a search; all zero but the first three at the beginning."""
    return Layout(
        (
            ("rest", 1),  # length still to go from the state
            ("reach", 1),  # length of the next attempt
            ("tolerance", 1),
            ("low", 1),  # longest attempt before the change
            ("high", 1),  # shortest attempt past it
            ("attempts", 1),  # made in this search
            ("side", 1),  # which of the two moved last: 1 high, −1 low
            ("count", 1),  # events met
            ("before", events),  # values at low, halved as Illinois does
            ("past", events),  # values at high
        )
    )


def judge_program(events: int) -> StraightLine:
    """(values, modes) → following, changed: modes of the values, and whether any is another."""
    values, modes = ca.SX.sym("values", events), ca.SX.sym("modes", events)
    following = values > 0
    function = ca.Function("judge", [values, modes], [following, _any(following != modes)])
    return _named(function, ("values", "modes"), ("following", "changed"))


_DECIDE_NAMES = (
    ("registers", "values", "ahead", "modes", "used"),
    ("following", "moved", "accepted", "passed", "located", "given_up"),
)


def decide_program(events: int) -> StraightLine:
    """What follows from an attempt.

    (registers, values, ahead, modes, used) → following, moved, accepted, passed, located, given_up:
    `values` at the state, `ahead` after the attempt of length `used`; `following` registers; the
    state moves on by `moved`, to where the attempt led if it is `accepted`, to where the shortest
    attempt past the change led if that is `located`; `passed` tells that this attempt is that one.
    """
    layout = registers(events)
    r, used = layout.symbols("registers"), ca.SX.sym("used")
    g, ahead, modes = (ca.SX.sym(name, events) for name in ("values", "ahead", "modes"))
    now = layout.split(r)
    going = now["rest"] > 0
    first = now["attempts"] == 0
    crossed = _any((ahead > 0) != modes)
    accepted = ca.logic_and(going, ca.logic_and(ca.logic_not(crossed), first))
    passed = ca.logic_and(going, crossed)
    short = ca.logic_and(going, ca.logic_and(ca.logic_not(crossed), ca.logic_not(first)))

    low = ca.if_else(short, used, now["low"])
    high = ca.if_else(passed, used, now["high"])
    before, past = _ends(now, ca.if_else(first, g, now["before"]), ahead, passed, short)
    attempts = now["attempts"] + 1
    searching = ca.logic_or(passed, short)
    narrow = ca.logic_or(high - low <= now["tolerance"], attempts >= _MOST_ATTEMPTS)
    located = ca.logic_and(searching, narrow)

    moved = ca.if_else(accepted, used, ca.if_else(located, high, 0))
    rest = now["rest"] - moved
    count = now["count"] + located
    given_up = count > EVENTS_PER_STEP
    rest = ca.if_else(given_up, 0, rest)
    again = ca.logic_or(accepted, located)
    reach = ca.if_else(again, rest, _next_length(low, high, before, past, modes, now, attempts))
    following = {
        "rest": rest,
        "reach": ca.if_else(going, reach, 0),
        "tolerance": now["tolerance"],
        "low": ca.if_else(again, 0, low),
        "high": high,
        "attempts": ca.if_else(again, 0, attempts),
        "side": ca.if_else(again, 0, ca.if_else(passed, 1, -1)),
        "count": count,
        "before": before,
        "past": past,
    }
    outputs = [layout.join(following), moved, accepted, passed, located, given_up]
    function = ca.Function("decide", [r, g, ahead, modes, used], outputs)
    return _named(function, *_DECIDE_NAMES)


def _ends(
    now: dict[str, ca.SX], before: ca.SX, ahead: ca.SX, passed: ca.SX, short: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Values at both ends after an attempt; an end that stays a second time counts half."""
    before = ca.if_else(ca.logic_and(passed, now["side"] == 1), before / 2, before)
    past = ca.if_else(ca.logic_and(short, now["side"] == -1), now["past"] / 2, now["past"])
    return ca.if_else(short, ahead, before), ca.if_else(passed, ahead, past)


def _next_length(
    low: ca.SX,
    high: ca.SX,
    before: ca.SX,
    past: ca.SX,
    modes: ca.SX,
    now: dict[str, ca.SX],
    attempts: ca.SX,
) -> ca.SX:
    width = high - low
    guess = high
    for j in range(modes.numel()):
        a, b = ca.fabs(before[j]), ca.fabs(past[j])
        crossing = ca.if_else((past[j] > 0) != modes[j], low + width * (a / (a + b)), high)
        guess = ca.fmin(crossing, guess)
    guess = ca.if_else(attempts > _PATIENCE, low + width / 2, guess)
    # Never nearer to an end than half the tolerance: the last attempt lands on the other side.
    margin = now["tolerance"] / 2
    return ca.fmin(ca.fmax(guess, low + margin), high - margin)


def _any(conditions: ca.SX) -> ca.SX:
    result = conditions[0]
    for j in range(1, conditions.numel()):
        result = ca.logic_or(result, conditions[j])
    return result


def _named(
    function: ca.Function, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> StraightLine:
    program = read_function(function, inputs=inputs)
    names = (entries for _, entries in program.outputs)
    return StraightLine(program.inputs, program.nodes, tuple(zip(outputs, names, strict=True)))


def only(program: StraightLine, *outputs: str) -> StraightLine:
    """The part of a program that some of its outputs need; each operation as it was."""
    builder = Builder()
    inputs = [builder.input(name, length) for name, length in program.inputs]
    made = call_program(builder, program, inputs)
    return builder.finish({name: made[name] for name in outputs})
