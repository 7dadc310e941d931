"""C text for runs of systems with events: steps that end where a mode changes."""

from __future__ import annotations

from dataclasses import dataclass

from mrac_design.codegen.c_source import c_routine
from mrac_design.codegen.straight_line import StraightLine
from mrac_design.simulation.event_search import (
    TOLERANCE,
    TURNS_AT_ONE_INSTANT,
    decide_program,
    judge_program,
    registers,
)
from mrac_design.simulation.method import Method, spans_records
from mrac_design.simulation.runge_kutta_text import (
    watched_extension_text,
    watched_stage_lines,
)
from mrac_design.simulation.side_by_side import rate_text
from mrac_design.simulation.stepping import prepare_watched
from mrac_design.simulation.system import MODES, HybridSystem


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramParts:
    """Where programs with and without events differ."""

    setup: StraightLine
    """p → what of the rate never changes."""
    routines: tuple[str, ...]
    """Functions of the equations."""
    step: str
    """Functions that step."""
    run: str
    """The function that runs; `{record}` stands for what records."""


_NUMBERS = """\
enum {{
    EVENTS = {events}, MODES_AT = {modes}, REGISTERS = {registers}, TURNS = {turns},
    SPANS = {spans}, KEPT = {kept}
}};
#define TOLERANCE {tolerance}
#define first_lane(s) {lane}
/* Kept out of the way of what every step does. */
#define RARELY __attribute__((noinline, cold))
"""
_SCALAR_PICK = """\
static inline real pick(real chosen, real a, real b) { return chosen != 0.0 ? a : b; }
"""
_VECTOR_PICK = """\
static inline real pick(real chosen, real a, real b)
{
    const mask c = chosen != 0.0;
    return (real)((c & (mask)a) | (~c & (mask)b));
}
"""

_LOG = """\
/* The log's first row holds how many rows follow, and how many may; a row is a time, an event and
   its new mode. The event -1 says that there were too many. */
static void note(double *log, double time, double event, double mode)
{
    const long count = (long)log[0];
    if (count >= (long)log[1]) return;
    if (count + 1 >= (long)log[1]) event = -1.0;
    log[0] = (double)(count + 1);
    double *row = log + 3 * (count + 1);
    row[0] = time;
    row[1] = event;
    row[2] = mode;
}

static void note_changes(double *log, double time, const real *before, const real *after)
{
    if (!log) return;
    for (int j = 0; j < EVENTS; ++j)
        if (after[j] != before[j]) note(log, time, (double)j, after[j]);
}

static void note_given_up(double *log, double time) { note(log, time, -1.0, 0.0); }
"""
_NO_LOG = """\
#define note_changes(log, time, before, after) (void)(log)
#define note_given_up(log, time) (void)(log)
"""

_LOCATED = """\
/* Slope and event values at x, at `origin + s`, in `concerned` lanes with the modes that belong
   to them. */
static void settle(const real *x, real *z, const real *segment, const real *p,
                   const real *prepared, real s, double origin, real concerned, real *slope,
                   real *values, double *log)
{
    real v[NV + 1], modes[EVENTS], changed;
    inputs_at(segment, s, v);
    hold(z, p, prepared, z + NZ);
    for (int turn = 0; turn < TURNS; ++turn) {
        rate(x, z, v, p, prepared, slope, values);
        judge(values, z + MODES_AT, modes, &changed);
        if (!real_any(pick(concerned, changed, splat(0.0)) != 0.0)) return;
        for (int j = 0; j < EVENTS; ++j) modes[j] = pick(concerned, modes[j], z[MODES_AT + j]);
        note_changes(log, origin + first_lane(s), z + MODES_AT, modes);
        memcpy(z + MODES_AT, modes, sizeof modes);
        hold(z, p, prepared, z + NZ);
    }
    rate(x, z, v, p, prepared, slope, values);
}

/* From x at time s within the segment over h, which ends at `arrival`, in steps that end at every
   event. Lanes over no length stay as they are. */
RARELY static void travel(real *x, real *z, const real *segment, const real *p,
                          const real *prepared, real s, real h, double arrival, double origin,
                          double *log)
{
    real y[WIDTH + 1], scratch[WIDTH + 1], past[WIDTH + 1];
    real k[STAGES][WIDTH + 1], v[NV + 1], values[EVENTS], ahead[EVENTS];
    real r[REGISTERS], next[REGISTERS], used, moved, accepted, passed, located, given_up;
    memset(k, 0, sizeof k);
    memset(past, 0, sizeof past);
    memset(r, 0, sizeof r);
    r[0] = r[1] = h;
    r[2] = h * TOLERANCE;
    settle(x, z, segment, p, prepared, s, origin, real_where(h > 0.0), k[0], values, log);
    while (real_any(r[0] > 0.0)) {
        step(x, z, segment, p, prepared, s, r[1], k, scratch, y, &used);
        inputs_at(segment, pick(real_where(used == h), splat(arrival), s + used), v);
        look(y, z, v, p, prepared, ahead);
        decide(r, values, ahead, z + MODES_AT, &used, next, &moved, &accepted, &passed, &located,
               &given_up);
        for (int i = 0; i < NX; ++i) {
            past[i] = pick(passed, y[i], past[i]);
            x[i] = pick(located, past[i], pick(accepted, y[i], x[i]));
            x[i] = pick(given_up, splat(NAN), x[i]);
        }
        s = pick(real_where(moved == h), splat(arrival), s + moved);
        memcpy(r, next, sizeof r);
        if (real_any(given_up != 0.0)) note_given_up(log, origin + first_lane(s));
        if (real_any(moved > 0.0))
            settle(x, z, segment, p, prepared, s, origin, real_where(moved > 0.0), k[0], values,
                   log);
    }
}
"""

_STEP = """\
/* One step of the {name} method from time s within the segment; its first slope is in k. */
static inline void step(const real *restrict x, const real *restrict z,
                        const real *restrict segment, const real *restrict p,
                        const real *restrict prepared, real s, real h,
                        real (*restrict k)[WIDTH + 1], real *restrict y,
                        real *restrict following, real *restrict used)
{{
    real v[NV + 1], values[EVENTS];
{code}
    *used = h;
}}
"""

_LOOK = """\
/* Event values alone: where the rate needs most of what they need there is no use in a shorter
   program. */
static void look(const real *x, const real *z, const real *v, const real *p,
                 const real *prepared, real *values)
{
    real slope[WIDTH + 1];
    rate(x, z, v, p, prepared, slope, values);
}
"""

_RUN = """\
/* Runs n intervals; returns how many of them began with a record. */
long run(long n, const double *start, const double *length, const long long *substeps,
         const long long *segment, const double *offset, const unsigned char *records,
         const unsigned char *updates, const real *coefficients, const real *p, real *state,
         real *memory, real *recorded LOG_ARGUMENT)
{
    LOG_DECLARATION
    const unsigned long before = flush_denormals();
    real v[NV + 1], prepared[PREPARED + 1], ready[READY + 1];
    real states[2][WIDTH + 1], *x = states[0], *y = states[1];
    real k[STAGES][WIDTH + 1], base[WIDTH + 1], scratch[WIDTH + 1];
    /* The slope at the end of a step is the first one of the next; where steps span records, the
       first one of this is needed until then. */
    real own[SPANS ? WIDTH + 1 : 1], *const following = SPANS ? own : k[0];
    real z[NZ + KEPT], values[EVENTS], modes[EVENTS], changed, used;
    /* Of the last step that spans records: its beginning, length and inputs, and the lanes that
       go through it again, from record to record. */
    double since = 0.0, last = 1.0, here = 0.0, origin = 0.0;
    const real *c = coefficients;
    real anew = splat(0.0);
    int fresh = 1;
    memset(base, 0, sizeof base);
    memset(states, 0, sizeof states);
    memset(k, 0, sizeof k);
    memset(own, 0, sizeof own);
    memcpy(x, state, NX * sizeof *x);
    memcpy(z, memory, NZ * sizeof *z);
    long rows = 0;
    rate_setup(p, prepared);
    record_setup(p, ready);
    for (long i = 0; i < n; ++i) {
        const real *at = x;
        if (substeps[i] == 0) {
            /* Inside the step before: the method tells the solution there. */
            between(base, k, last, (offset[i] - since) / last, y);
            if (real_any(anew != 0.0)) {
                travel(x, z, c, p, prepared, splat(here), pick(anew, splat(offset[i] - here),
                       splat(0.0)), offset[i], origin, log);
                here = offset[i];
                for (int m = 0; m < NX; ++m) y[m] = pick(anew, x[m], y[m]);
            }
            at = y;
        } else if (real_any(anew != 0.0)) {
            const double end = since + last;
            travel(x, z, c, p, prepared, splat(here), pick(anew, splat(end - here), splat(0.0)),
                   end, origin, log);
            anew = splat(0.0);
        }
        c = coefficients + (size_t)segment[i] * NV * POWERS;
        if (records[i] || updates[i]) inputs_at(c, splat(offset[i]), v);
        if (updates[i]) sample(x, z, v, p);
        if (records[i]) {
            {record}
            ++rows;
        }
        if (substeps[i] == 0) continue;
        const double h = length[i] / (double)substeps[i];
        origin = start[i] - offset[i];
        long after = i + 1;
        while (after < n && substeps[after] == 0) ++after;
        const int spans = after > i + 1;
        /* Whether the slope at the end is the one the next step begins with. */
        const int same = after < n && segment[after] == segment[i] && !updates[after];
        const double end = same ? offset[after] : offset[i] + length[i];
        for (long long j = 0; j < substeps[i]; ++j) {
            const int final = j + 1 == substeps[i];
            const double s = offset[i] + (double)j * h;
            const double arrival = final ? end : offset[i] + (double)(j + 1) * h;
            if (fresh)
                settle(x, z, c, p, prepared, splat(s), origin, splat(1.0), k[0], values,
                       origin + s > 0.0 ? log : NULL);
            else if (SPANS)
                memcpy(k[0], following, sizeof k[0]);
            fresh = 1;
            step(x, z, c, p, prepared, splat(s), splat(h), k, scratch, y, &used);
            inputs_at(c, splat(arrival), v);
            if (!final || same || spans) rate(y, z, v, p, prepared, following, values);
            else look(y, z, v, p, prepared, values);
            judge(values, z + MODES_AT, modes, &changed);
            if (SPANS && spans) {
                memcpy(base, x, sizeof base);
                since = here = s;
                last = h;
                extend(base, following, z, c, p, prepared, s, h, k, scratch);
            }
            if (!real_any(changed != 0.0)) {
                real *const reached = y;
                y = x;
                x = reached;
                fresh = final && !same;
            } else if (SPANS && spans) {
                anew = changed;
                for (int m = 0; m < NX; ++m) x[m] = pick(anew, x[m], y[m]);
            } else {
                travel(x, z, c, p, prepared, splat(s), splat(h), arrival, origin, log);
            }
        }
    }
    if (real_any(anew != 0.0))
        travel(x, z, c, p, prepared, splat(here), pick(anew, splat(since + last - here),
               splat(0.0)), since + last, origin, log);
    memcpy(state, x, NX * sizeof *x);
    memcpy(memory, z, NZ * sizeof *z);
    restore_denormals(before);
    return rows;
}
"""


def located_parts(system: HybridSystem, method: Method, *, lanes: int, logs: bool) -> ProgramParts:
    """What a program for a system with events needs beside what every program has.

    Where it `logs`, `run` has one more argument, `log`, see `note`.
    """
    watched, events = prepare_watched(system), len(system.events)
    routines = [
        c_routine(judge_program(events), "judge"),
        c_routine(decide_program(events), "decide"),
        c_routine(watched.hold, "hold", inputs=["z", "p", "prepared"]),
    ]
    setup, text = rate_text(system.state, watched.rate.setup, watched.both, lanes)
    routines.append(text)
    code = "\n".join(watched_stage_lines(method))
    step = _STEP.format(name=method.name, code=code) + watched_extension_text(method)
    # Between samples the rate needs little of what the events need, and the other way round.
    if system.update is None:
        step = _LOOK + step
    else:
        routines.append(c_routine(watched.events, "look"))
    numbers = _NUMBERS.format(
        events=events,
        modes=system.held.slices[MODES].start,
        registers=registers(events).size,
        spans=int(spans_records(method)),
        kept=len(watched.hold.output("kept")),
        turns=TURNS_AT_ONE_INSTANT,
        tolerance=repr(TOLERANCE),
        lane="(s)" if lanes == 1 else "(s)[0]",
    )
    return ProgramParts(
        setup=setup,
        routines=tuple(routines),
        step="\n".join(
            [
                numbers,
                _SCALAR_PICK if lanes == 1 else _VECTOR_PICK,
                _LOG if logs else _NO_LOG,
                step,
                _LOCATED,
            ]
        ),
        run=_RUN.replace(" LOG_ARGUMENT", ", double *log" if logs else "").replace(
            "    LOG_DECLARATION\n", "" if logs else "    double *const log = NULL;\n"
        ),
    )
