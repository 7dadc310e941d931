"""The program that runs a hybrid system in LLVM's assembly language, where no C compiler is."""

from __future__ import annotations

import platform

from mrac_design.codegen.llvm_source import declarations, llvm_routine
from mrac_design.codegen.reading import read_function
from mrac_design.codegen.straight_line import Builder, StraightLine
from mrac_design.simulation.emission import simplified
from mrac_design.simulation.method import Method
from mrac_design.simulation.stepping import (
    ARGUMENTS,
    finished,
    input_values,
    prepare,
    step_program,
)
from mrac_design.simulation.system import HybridSystem

_TEMPLATE = """\
{declarations}
declare void @llvm.memcpy.p0.p0.i64(ptr, ptr, i64, i1)
{functions}
define i64 @run(i64 %n, ptr %start, ptr %length, ptr %substeps, ptr %segment, ptr %offset,
                ptr %records, ptr %updates, ptr %coefficients, ptr %p, ptr %x, ptr %z,
                ptr %recorded) {{
entry:
  %v = alloca [{inputs} x double]
  %prepared = alloca [{prepared} x double]
  %ready = alloca [{ready} x double]
  %following = alloca [{states} x double]
  %next = alloca [{held} x double]
  %time = alloca double
  %rest = alloca double
  %used = alloca double
  %before = alloca i32
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
  br label %substep
substep:
  %j = phi i64 [0, %written], [%j_next, %stepped]
  %left = icmp slt i64 %j, %count
  br i1 %left, label %set, label %finished
set:
  %done = sitofp i64 %j to double
  %elapsed = fmul double %done, %h
  %at = fadd double %since, %elapsed
  store double %at, ptr %time
  store double %h, ptr %rest
  br label %advance
advance:
  call void @step(ptr %x, ptr %z, ptr %c, ptr %time, ptr %rest, ptr %p, ptr %prepared,
                  ptr %following, ptr %used)
  call void @llvm.memcpy.p0.p0.i64(ptr %x, ptr %following, i64 {state_bytes}, i1 false)
  %time_before = load double, ptr %time
  %rest_before = load double, ptr %rest
  %passed = load double, ptr %used
  %time_after = fadd double %time_before, %passed
  %rest_after = fsub double %rest_before, %passed
  store double %time_after, ptr %time
  store double %rest_after, ptr %rest
  %again = fcmp ogt double %rest_after, 0.0
  br i1 %again, label %advance, label %stepped
stepped:
  %j_next = add i64 %j, 1
  br label %substep
finished:
  %i_next = add i64 %i, 1
  br label %interval
end:
  {restore}
  ret i64 %rows
}}
"""

_UPDATE = """\
call void @update(ptr %x, ptr %z, ptr %v, ptr %p, ptr %next)
  call void @llvm.memcpy.p0.p0.i64(ptr %z, ptr %next, i64 {held_bytes}, i1 false)"""
_DECLARE_FLUSH = """\
declare void @llvm.x86.sse.stmxcsr(ptr)
declare void @llvm.x86.sse.ldmxcsr(ptr)
"""
_FLUSH = """\
call void @llvm.x86.sse.stmxcsr(ptr %before)
  %mode = load i32, ptr %before
  %flushing = or i32 %mode, 32832
  store i32 %flushing, ptr %inside
  call void @llvm.x86.sse.ldmxcsr(ptr %inside)"""
_RESTORE = "call void @llvm.x86.sse.ldmxcsr(ptr %before)"


def llvm_program(system: HybridSystem, method: Method, *, input_powers: int) -> str:
    """Module with one exported function, `run`, the same as `c_program`'s for one run."""
    rate, record = prepare(system.rate), prepare(system.output)
    x86 = platform.machine() in ("x86_64", "AMD64")
    routines = [
        _DECLARE_FLUSH if x86 else "",
        llvm_routine(rate.setup, "rate_setup", inputs=["p"]),
        llvm_routine(record.setup, "record_setup", inputs=["p"]),
        llvm_routine(finished(record.body), "output"),
        llvm_routine(step_program(system, rate, method, input_powers), "step"),
        llvm_routine(_inputs_at(system, input_powers), "inputs_at"),
    ]
    if system.update is not None:
        update = read_function(simplified(system.update), inputs=ARGUMENTS)
        routines.append(llvm_routine(update, "update"))
    return _TEMPLATE.format(
        declarations=declarations(),
        functions="\n".join(routines),
        states=system.state.size,
        state_bytes=8 * system.state.size,
        held=max(1, system.held.size),
        inputs=max(1, system.inputs.size),
        outputs=system.outputs.size,
        segment_size=system.inputs.size * input_powers,
        prepared=len(rate.setup.output("prepared")) or 1,
        ready=len(record.setup.output("prepared")) or 1,
        update=_UPDATE.format(held_bytes=8 * system.held.size) if system.update else "",
        flush=_FLUSH if x86 else "",
        restore=_RESTORE if x86 else "",
    )


def _inputs_at(system: HybridSystem, powers: int) -> StraightLine:
    builder = Builder()
    segment = builder.input("segment", system.inputs.size * powers)
    time = builder.input("s", 1)[0]
    return builder.finish({"v": input_values(builder, segment, powers, time)})
