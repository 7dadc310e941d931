"""Functions of LLVM programs that end steps where a mode changes; see `located_program`."""

from __future__ import annotations

from mrac_design.codegen.llvm_source import literal, llvm_routine
from mrac_design.simulation.event_search import (
    TOLERANCE,
    TURNS_AT_ONE_INSTANT,
    decide_program,
    judge_program,
    registers,
)
from mrac_design.simulation.method import Method
from mrac_design.simulation.stepping import Watched, step_program
from mrac_design.simulation.system import MODES, HybridSystem

_LOG = """\
define internal void @note(ptr %log, double %time, double %event, double %mode) {{
  %count_before = load double, ptr %log
  %capacity_at = getelementptr double, ptr %log, i64 1
  %capacity = load double, ptr %capacity_at
  %full = fcmp oge double %count_before, %capacity
  br i1 %full, label %end, label %writing
writing:
  %count = fadd double %count_before, 1.0
  %last = fcmp oge double %count, %capacity
  %named = select i1 %last, double -1.0, double %event
  store double %count, ptr %log
  %number = fptosi double %count to i64
  %place = mul i64 %number, 3
  %row = getelementptr double, ptr %log, i64 %place
  store double %time, ptr %row
  %event_at = getelementptr double, ptr %row, i64 1
  store double %named, ptr %event_at
  %mode_at = getelementptr double, ptr %row, i64 2
  store double %mode, ptr %mode_at
  br label %end
end:
  ret void
}}

define internal void @note_changes(ptr %log, double %time, ptr %before, ptr %after) {{
entry:
  %silent = icmp eq ptr %log, null
  br i1 %silent, label %end, label %next
next:
  %j = phi i64 [0, %entry], [%j_next, %done]
  %more = icmp slt i64 %j, {events}
  br i1 %more, label %compare, label %end
compare:
  %before_at = getelementptr double, ptr %before, i64 %j
  %after_at = getelementptr double, ptr %after, i64 %j
  %old = load double, ptr %before_at
  %new = load double, ptr %after_at
  %differs = fcmp une double %old, %new
  br i1 %differs, label %write, label %done
write:
  %event = sitofp i64 %j to double
  call void @note(ptr %log, double %time, double %event, double %new)
  br label %done
done:
  %j_next = add i64 %j, 1
  br label %next
end:
  ret void
}}
"""
_SETTLE = """\
define internal void @settle(ptr %x, ptr %z, ptr %c, ptr %time, double %origin, ptr %p,
                             ptr %prepared, ptr %slope, ptr %values, ptr %log) {{
entry:
  %v = alloca [{inputs} x double]
  %modes = alloca [{events} x double]
  %changed = alloca double
  %held = getelementptr double, ptr %z, i64 {modes_at}
  %kept = getelementptr double, ptr %z, i64 {held}
  call void @inputs_at(ptr %c, ptr %time, ptr %v)
  call void @hold(ptr %z, ptr %p, ptr %prepared, ptr %kept)
  br label %turn
turn:
  %t = phi i64 [0, %entry], [%t_next, %changing]
  call void @rate(ptr %x, ptr %z, ptr %v, ptr %p, ptr %prepared, ptr %slope, ptr %values)
  %last = icmp eq i64 %t, {turns}
  br i1 %last, label %end, label %judging
judging:
  call void @judge(ptr %values, ptr %held, ptr %modes, ptr %changed)
  %any = load double, ptr %changed
  %changes = fcmp une double %any, 0.0
  br i1 %changes, label %changing, label %end
changing:
  %s = load double, ptr %time
  %at = fadd double %origin, %s
  call void @note_changes(ptr %log, double %at, ptr %held, ptr %modes)
  call void @llvm.memcpy.p0.p0.i64(ptr %held, ptr %modes, i64 {event_bytes}, i1 false)
  call void @hold(ptr %z, ptr %p, ptr %prepared, ptr %kept)
  %t_next = add i64 %t, 1
  br label %turn
end:
  ret void
}}
"""
_TRAVEL = """\
define internal void @travel(ptr %x, ptr %z, ptr %c, double %start, double %h, double %arrival,
                             double %origin, ptr %p, ptr %prepared, ptr %log) {{
entry:
  %v = alloca [{inputs} x double]
  %y = alloca [{states} x double]
  %past = alloca [{states} x double]
  %slope = alloca [{states} x double]
  %values = alloca [{events} x double]
  %ahead = alloca [{events} x double]
  %r = alloca [{registers} x double]
  %following = alloca [{registers} x double]
  %time = alloca double
  %end_time = alloca double
  %used = alloca double
  %moved = alloca double
  %accepted = alloca double
  %passed = alloca double
  %located = alloca double
  %given_up = alloca double
  %held = getelementptr double, ptr %z, i64 {modes_at}
  call void @llvm.memset.p0.i64(ptr %r, i8 0, i64 {register_bytes}, i1 false)
  %reach = getelementptr double, ptr %r, i64 1
  %tolerance_at = getelementptr double, ptr %r, i64 2
  %tolerance = fmul double %h, {tolerance}
  store double %h, ptr %r
  store double %h, ptr %reach
  store double %tolerance, ptr %tolerance_at
  store double %start, ptr %time
  call void @llvm.memcpy.p0.p0.i64(ptr %past, ptr %x, i64 {state_bytes}, i1 false)
  call void @settle(ptr %x, ptr %z, ptr %c, ptr %time, double %origin, ptr %p, ptr %prepared,
                    ptr %slope, ptr %values, ptr %log)
  br label %attempt
attempt:
  %rest = load double, ptr %r
  %going = fcmp ogt double %rest, 0.0
  br i1 %going, label %try, label %end
try:
  call void @step(ptr %x, ptr %z, ptr %c, ptr %time, ptr %reach, ptr %p, ptr %prepared,
                  ptr %slope, ptr %y, ptr %used)
  %s = load double, ptr %time
  %length = load double, ptr %used
  %reached = fadd double %s, %length
  %all = fcmp oeq double %length, %h
  %there = select i1 %all, double %arrival, double %reached
  store double %there, ptr %end_time
  call void @inputs_at(ptr %c, ptr %end_time, ptr %v)
  call void @look(ptr %y, ptr %z, ptr %v, ptr %p, ptr %prepared, ptr %ahead)
  call void @decide(ptr %r, ptr %values, ptr %ahead, ptr %held, ptr %used, ptr %following,
                    ptr %moved, ptr %accepted, ptr %passed, ptr %located, ptr %given_up)
  %is_accepted_number = load double, ptr %accepted
  %is_passed_number = load double, ptr %passed
  %is_located_number = load double, ptr %located
  %is_given_up_number = load double, ptr %given_up
  %is_accepted = fcmp une double %is_accepted_number, 0.0
  %is_passed = fcmp une double %is_passed_number, 0.0
  %is_located = fcmp une double %is_located_number, 0.0
  %is_given_up = fcmp une double %is_given_up_number, 0.0
  br label %entry_of_state
entry_of_state:
  %i = phi i64 [0, %try], [%i_next, %keep]
  %more = icmp slt i64 %i, {states}
  br i1 %more, label %keep, label %kept
keep:
  %x_at = getelementptr double, ptr %x, i64 %i
  %y_at = getelementptr double, ptr %y, i64 %i
  %past_at = getelementptr double, ptr %past, i64 %i
  %x_old = load double, ptr %x_at
  %y_old = load double, ptr %y_at
  %past_old = load double, ptr %past_at
  %past_new = select i1 %is_passed, double %y_old, double %past_old
  %x_whole = select i1 %is_accepted, double %y_old, double %x_old
  %x_met = select i1 %is_located, double %past_new, double %x_whole
  %x_new = select i1 %is_given_up, double 0x7FF8000000000000, double %x_met
  store double %past_new, ptr %past_at
  store double %x_new, ptr %x_at
  %i_next = add i64 %i, 1
  br label %entry_of_state
kept:
  %way = load double, ptr %moved
  %gone = fadd double %s, %way
  %done = fcmp oeq double %way, %h
  %now = select i1 %done, double %arrival, double %gone
  store double %now, ptr %time
  call void @llvm.memcpy.p0.p0.i64(ptr %r, ptr %following, i64 {register_bytes}, i1 false)
  br i1 %is_given_up, label %giving_up, label %on
giving_up:
  %instant = fadd double %origin, %now
  call void @note(ptr %log, double %instant, double -1.0, double 0.0)
  br label %on
on:
  %moving = fcmp ogt double %way, 0.0
  br i1 %moving, label %settling, label %attempt
settling:
  call void @settle(ptr %x, ptr %z, ptr %c, ptr %time, double %origin, ptr %p, ptr %prepared,
                    ptr %slope, ptr %values, ptr %log)
  br label %attempt
end:
  ret void
}}
"""
_LEAP = """\
define internal i1 @leap(ptr %x, ptr %z, ptr %c, double %start, double %h, double %arrival,
                         double %origin, ptr %p, ptr %prepared, ptr %log, i1 %fresh, i1 %carried,
                         ptr %slope, ptr %values) {{
entry:
  %v = alloca [{inputs} x double]
  %y = alloca [{states} x double]
  %next = alloca [{states} x double]
  %ahead = alloca [{events} x double]
  %modes = alloca [{events} x double]
  %changed = alloca double
  %time = alloca double
  %whole = alloca double
  %used = alloca double
  %held = getelementptr double, ptr %z, i64 {modes_at}
  store double %start, ptr %time
  store double %h, ptr %whole
  %instant = fadd double %origin, %start
  %running = fcmp ogt double %instant, 0.0
  %heard = select i1 %running, ptr %log, ptr null
  br i1 %fresh, label %settling, label %settled
settling:
  call void @settle(ptr %x, ptr %z, ptr %c, ptr %time, double %origin, ptr %p, ptr %prepared,
                    ptr %slope, ptr %values, ptr %heard)
  br label %settled
settled:
  br label %try
try:
  call void @step(ptr %x, ptr %z, ptr %c, ptr %time, ptr %whole, ptr %p, ptr %prepared,
                  ptr %slope, ptr %y, ptr %used)
  store double %arrival, ptr %time
  call void @inputs_at(ptr %c, ptr %time, ptr %v)
  br i1 %carried, label %carrying, label %looking
carrying:
  call void @rate(ptr %y, ptr %z, ptr %v, ptr %p, ptr %prepared, ptr %next, ptr %ahead)
  br label %seen
looking:
  call void @look(ptr %y, ptr %z, ptr %v, ptr %p, ptr %prepared, ptr %ahead)
  br label %seen
seen:
  call void @judge(ptr %ahead, ptr %held, ptr %modes, ptr %changed)
  %any = load double, ptr %changed
  %changes = fcmp une double %any, 0.0
  br i1 %changes, label %locate, label %accept
accept:
  call void @llvm.memcpy.p0.p0.i64(ptr %x, ptr %y, i64 {state_bytes}, i1 false)
  call void @llvm.memcpy.p0.p0.i64(ptr %slope, ptr %next, i64 {state_bytes}, i1 false)
  call void @llvm.memcpy.p0.p0.i64(ptr %values, ptr %ahead, i64 {event_bytes}, i1 false)
  %stale = xor i1 %carried, true
  ret i1 %stale
locate:
  call void @travel(ptr %x, ptr %z, ptr %c, double %start, double %h, double %arrival,
                    double %origin, ptr %p, ptr %prepared, ptr %log)
  ret i1 true
}}
"""


def locating_functions(
    system: HybridSystem, watched: Watched, method: Method, *, powers: int
) -> str:
    """`leap`, a step with whatever events are in it, and what it calls except `inputs_at`.

    It returns whether slope and event values must be made anew for the next step.
    """
    events, count = len(system.events), registers(len(system.events)).size
    numbers = {
        "states": system.state.size,
        "state_bytes": 8 * system.state.size,
        "inputs": max(1, system.inputs.size),
        "events": events,
        "event_bytes": 8 * events,
        "modes_at": system.held.slices[MODES].start,
        "held": system.held.size,
        "registers": count,
        "register_bytes": 8 * count,
        "turns": TURNS_AT_ONE_INSTANT,
        "tolerance": literal(TOLERANCE),
    }
    step = step_program(system, watched.rate, method, powers, watched=watched)
    return "\n".join(
        [
            "declare void @llvm.memset.p0.i64(ptr, i8, i64, i1)",
            llvm_routine(step, "step"),
            llvm_routine(watched.both, "rate"),
            llvm_routine(watched.events, "look"),
            llvm_routine(watched.hold, "hold", inputs=["z", "p", "prepared"]),
            llvm_routine(judge_program(events), "judge"),
            llvm_routine(decide_program(events), "decide"),
            *(text.format(**numbers) for text in (_LOG, _SETTLE, _TRAVEL, _LEAP)),
        ]
    )
