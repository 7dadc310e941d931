"""The program that runs a hybrid system in LLVM's assembly language, where no C compiler is."""

from __future__ import annotations

import platform
from dataclasses import dataclass

from mrac_design.codegen.llvm_source import declarations, llvm_routine
from mrac_design.codegen.reading import read_function
from mrac_design.codegen.straight_line import Builder, StraightLine
from mrac_design.simulation.emission import simplified
from mrac_design.simulation.llvm_location import locating_functions
from mrac_design.simulation.method import Method
from mrac_design.simulation.stepping import (
    ARGUMENTS,
    finished,
    input_values,
    prepare,
    prepare_watched,
    step_program,
)
from mrac_design.simulation.system import HybridSystem

_TEMPLATE = """\
{declarations}
declare void @llvm.memcpy.p0.p0.i64(ptr, ptr, i64, i1)
{functions}
define i64 @run(i64 %n, ptr %start, ptr %length, ptr %substeps, ptr %segment, ptr %offset,
                ptr %records, ptr %updates, ptr %coefficients, ptr %p, ptr %x, ptr {memory},
                ptr %recorded{log}) {{
entry:
  %v = alloca [{inputs} x double]
  %prepared = alloca [{prepared} x double]
  %ready = alloca [{ready} x double]
  %next = alloca [{held} x double]
  %time = alloca double
{variables}  %before = alloca i32
  %inside = alloca i32
  {flush}
  call void @rate_setup(ptr %p, ptr %prepared)
  call void @record_setup(ptr %p, ptr %ready)
  br label %interval
interval:
  %i = phi i64 [0, %entry], [%i_next, %finished]
  %rows = phi i64 [0, %entry], [%rows_next, %finished]
  %more = icmp slt i64 %i, %n
  br i1 %more, label %begin, label %end
begin:
  %segment_at = getelementptr i64, ptr %segment, i64 %i
  %number = load i64, ptr %segment_at
  %skipped = mul i64 %number, {segment_size}
  %c = getelementptr double, ptr %coefficients, i64 %skipped
  %offset_at = getelementptr double, ptr %offset, i64 %i
  %since = load double, ptr %offset_at
  store double %since, ptr %time
  call void @inputs_at(ptr %c, ptr %time, ptr %v)
  %updates_at = getelementptr i8, ptr %updates, i64 %i
  %update_flag = load i8, ptr %updates_at
  %updating = icmp ne i8 %update_flag, 0
  br i1 %updating, label %sampling, label %sampled
sampling:
  {update}
  br label %sampled
sampled:
  %records_at = getelementptr i8, ptr %records, i64 %i
  %record_flag = load i8, ptr %records_at
  %recording = icmp ne i8 %record_flag, 0
  br i1 %recording, label %writing, label %written
writing:
  %skipped_rows = mul i64 %rows, {outputs}
  %row = getelementptr double, ptr %recorded, i64 %skipped_rows
  call void @output(ptr %x, ptr %z, ptr %v, ptr %p, ptr %ready, ptr %row)
  br label %written
written:
  %one = zext i1 %recording to i64
  %rows_next = add i64 %rows, %one
  %length_at = getelementptr double, ptr %length, i64 %i
  %whole = load double, ptr %length_at
  %substeps_at = getelementptr i64, ptr %substeps, i64 %i
  %count = load i64, ptr %substeps_at
  %divisor = sitofp i64 %count to double
  %h = fdiv double %whole, %divisor
{substeps}end:
  {restore}
{leave}  ret i64 %rows
}}
"""

_PLAIN_SUBSTEPS = """\
  br label %substep
substep:
  %j = phi i64 [0, %written], [%j_next, %set]
  %left = icmp slt i64 %j, %count
  br i1 %left, label %set, label %finished
set:
  %done = sitofp i64 %j to double
  %elapsed = fmul double %done, %h
  %at = fadd double %since, %elapsed
  store double %at, ptr %time
  store double %h, ptr %whole_step
  call void @step(ptr %x, ptr %z, ptr %c, ptr %time, ptr %whole_step, ptr %p, ptr %prepared,
                  ptr %following, ptr %used)
  call void @llvm.memcpy.p0.p0.i64(ptr %x, ptr %following, i64 {state_bytes}, i1 false)
  %j_next = add i64 %j, 1
  br label %substep
finished:
  %i_next = add i64 %i, 1
  br label %interval
"""

_LOCATED_SUBSTEPS = """\
  %start_at = getelementptr double, ptr %start, i64 %i
  %instant = load double, ptr %start_at
  %origin = fsub double %instant, %since
  %after = add i64 %i, 1
  %followed = icmp slt i64 %after, %n
  br i1 %followed, label %ahead, label %alone
ahead:
  %segment_after_at = getelementptr i64, ptr %segment, i64 %after
  %segment_after = load i64, ptr %segment_after_at
  %updates_after_at = getelementptr i8, ptr %updates, i64 %after
  %updates_after = load i8, ptr %updates_after_at
  %offset_after_at = getelementptr double, ptr %offset, i64 %after
  %offset_after = load double, ptr %offset_after_at
  %same_segment = icmp eq i64 %segment_after, %number
  %no_update = icmp eq i8 %updates_after, 0
  %goes_on = and i1 %same_segment, %no_update
  br label %alone
alone:
  %same = phi i1 [false, %written], [%goes_on, %ahead]
  %follows = phi double [0.0, %written], [%offset_after, %ahead]
  %stop = fadd double %since, %whole
  %finish = select i1 %same, double %follows, double %stop
  br label %substep
substep:
  %j = phi i64 [0, %alone], [%j_next, %leaping]
  %left = icmp slt i64 %j, %count
  br i1 %left, label %leaping, label %finished
leaping:
  %j_next = add i64 %j, 1
  %final = icmp eq i64 %j_next, %count
  %done = sitofp i64 %j to double
  %elapsed = fmul double %done, %h
  %at = fadd double %since, %elapsed
  %done_next = sitofp i64 %j_next to double
  %elapsed_next = fmul double %done_next, %h
  %at_next = fadd double %since, %elapsed_next
  %arrival = select i1 %final, double %finish, double %at_next
  %carried = select i1 %final, i1 %same, i1 true
  %fresh_now = load i1, ptr %fresh
  %fresh_next = call i1 @leap(ptr %x, ptr %z, ptr %c, double %at, double %h, double %arrival,
                              double %origin, ptr %p, ptr %prepared, ptr %log, i1 %fresh_now,
                              i1 %carried, ptr %slope, ptr %values)
  store i1 %fresh_next, ptr %fresh
  br label %substep
finished:
  %i_next = add i64 %i, 1
  br label %interval
"""

_PLAIN_VARIABLES = """\
  %following = alloca [{states} x double]
  %whole_step = alloca double
  %used = alloca double
"""
_LOCATED_VARIABLES = """\
  %z = alloca [{memory} x double]
  call void @llvm.memcpy.p0.p0.i64(ptr %z, ptr %memory, i64 {held_bytes}, i1 false)
  %slope = alloca [{states} x double]
  %values = alloca [{events} x double]
  %fresh = alloca i1
  store i1 true, ptr %fresh
"""
_LEAVE = """\
  call void @llvm.memcpy.p0.p0.i64(ptr %memory, ptr %z, i64 {held_bytes}, i1 false)
"""
_UPDATE = """\
call void @update(ptr %x, ptr %z, ptr %v, ptr %p, ptr %next)
  call void @llvm.memcpy.p0.p0.i64(ptr %z, ptr %next, i64 {held_bytes}, i1 false)"""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Denormals:
    """How a processor is told to take denormal numbers for zero."""

    declare: str = ""
    """Functions that read and set its mode."""
    flush: str = ""
    """From here on."""
    restore: str = ""
    """And back."""


_X86 = _Denormals(
    declare="""\
declare void @llvm.x86.sse.stmxcsr(ptr)
declare void @llvm.x86.sse.ldmxcsr(ptr)
""",
    flush="""\
call void @llvm.x86.sse.stmxcsr(ptr %before)
  %mode = load i32, ptr %before
  %flushing = or i32 %mode, 32832
  store i32 %flushing, ptr %inside
  call void @llvm.x86.sse.ldmxcsr(ptr %inside)""",
    restore="call void @llvm.x86.sse.ldmxcsr(ptr %before)",
)
_ARM = _Denormals(
    declare="""\
declare i64 @llvm.aarch64.get.fpcr()
declare void @llvm.aarch64.set.fpcr(i64)
""",
    flush="""\
%mode = call i64 @llvm.aarch64.get.fpcr()
  %flushing = or i64 %mode, 16777216
  call void @llvm.aarch64.set.fpcr(i64 %flushing)""",
    restore="call void @llvm.aarch64.set.fpcr(i64 %mode)",
)
_DENORMALS = {"x86_64": _X86, "amd64": _X86, "aarch64": _ARM, "arm64": _ARM}


def llvm_program(system: HybridSystem, method: Method, *, input_powers: int) -> str:
    """Module with one exported function, `run`, the same as `c_program`'s for one run."""
    watched = prepare_watched(system) if system.events else None
    rate, record = prepare(system.rate) if watched is None else watched.rate, prepare(system.output)
    denormals = _DENORMALS.get(platform.machine().lower(), _Denormals())
    routines = [
        denormals.declare,
        llvm_routine(rate.setup, "rate_setup", inputs=["p"]),
        llvm_routine(record.setup, "record_setup", inputs=["p"]),
        llvm_routine(finished(record.body), "output"),
        llvm_routine(_inputs_at(system, input_powers), "inputs_at"),
    ]
    if watched is None:
        routines.append(llvm_routine(step_program(system, rate, method, input_powers), "step"))
    else:
        routines.append(locating_functions(system, watched, method, powers=input_powers))
    if system.update is not None:
        update = read_function(simplified(system.update), inputs=ARGUMENTS)
        routines.append(llvm_routine(update, "update"))
    kept = 0 if watched is None else len(watched.hold.output("kept"))
    sizes = {
        "memory": system.held.size + kept,
        "held_bytes": 8 * system.held.size,
        "states": system.state.size,
        "state_bytes": 8 * system.state.size,
        "events": len(system.events),
    }
    variables, substeps = (
        (_PLAIN_VARIABLES, _PLAIN_SUBSTEPS)
        if watched is None
        else (_LOCATED_VARIABLES, _LOCATED_SUBSTEPS)
    )
    return _TEMPLATE.format(
        declarations=declarations(),
        functions="\n".join(routines),
        log="" if watched is None else ", ptr %log",
        memory="%z" if watched is None else "%memory",
        leave="" if watched is None else _LEAVE.format(**sizes),
        variables=variables.format(**sizes),
        substeps=substeps.format(**sizes),
        held=max(1, system.held.size),
        inputs=max(1, system.inputs.size),
        outputs=system.outputs.size,
        segment_size=system.inputs.size * input_powers,
        prepared=len(rate.setup.output("prepared")) or 1,
        ready=len(record.setup.output("prepared")) or 1,
        update=_UPDATE.format(held_bytes=8 * system.held.size) if system.update else "",
        flush=denormals.flush,
        restore=denormals.restore,
    )


def _inputs_at(system: HybridSystem, powers: int) -> StraightLine:
    builder = Builder()
    segment = builder.input("segment", system.inputs.size * powers)
    time = builder.input("s", 1)[0]
    return builder.finish({"v": input_values(builder, segment, powers, time)})
