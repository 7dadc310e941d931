"""What is told about a record, against counting by hand."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mrac_design.export.c_counts import StepCosts
from mrac_design.realtime import RealtimeRecord
from mrac_design.realtime.record import TABLE_HEADER, time_percentiles, torque_agreement

TIMES = st.lists(st.floats(1e-9, 1.0), min_size=1, max_size=300)


@given(TIMES)
def test_percentiles_are_times_that_occurred(times):
    told = time_percentiles(np.array(times))
    ordered = sorted(times)
    for share, value in ((0.5, told.p50), (0.99, told.p99), (0.999, told.p999), (1, told.maximum)):
        # Nearest rank: the least sample that a share of all samples does not exceed. The product
        # is rounded before its ceiling, as share · N may miss a whole number by an ulp.
        assert value == ordered[math.ceil(round(share * len(ordered), 9)) - 1]


def record(wake: list[float], step: list[float], cycle: list[float]) -> RealtimeRecord:
    return RealtimeRecord(
        period=1e-3,
        wake=np.array(wake),
        step=np.array(step),
        cycle=np.array(cycle),
        torque=np.zeros((len(wake), 2)),
        identity="",
        memory_lock="",
        priority="Operation not permitted",
        clock_cost=2e-8,
        page_faults=0,
        preemptions=3,
    )


def test_a_period_is_missed_when_its_torque_comes_after_its_end():
    #                late enough   late by its step   torque in time, robot late   just in time
    own = record([2e-3, 0.9e-3, 0.1e-3, 0.5e-3], [1e-6, 2e-4, 1e-6, 5e-4], [3e-3, 2e-3, 2e-3, 1e-3])
    assert own.missed == 2
    assert own.overrun == 3


@given(st.integers(0, 19), st.integers(0, 1), st.sampled_from([5e-324, 0.5, -2.0]))
def test_agreement_sees_a_single_bit(row, column, change):
    simulated = np.zeros((20, 2))
    measured = simulated.copy()
    limits = np.array([2.0, 4.0])
    same = torque_agreement(measured, simulated, limits=limits, period=0.25)
    assert same.equal
    assert same.first_difference is None
    measured[row, column] = change
    other = torque_agreement(measured, simulated, limits=limits, period=0.25)
    assert not other.equal
    assert other.first_difference == 0.25 * row
    assert other.largest_difference == abs(change) / limits[column]


def test_agreement_tells_zeros_apart():
    agreement = torque_agreement(
        np.array([[-0.0]]), np.array([[0.0]]), limits=np.ones(1), period=1.0
    )
    assert not agreement.equal
    assert agreement.largest_difference == 0.0


def test_values_are_plain_and_complete(report):
    values = json.loads(json.dumps(report.values(), allow_nan=False))
    assert [run["rate_Hz"] for run in values["runs"]] == [1000.0, 1300.0]
    run, own = values["runs"][0], report.runs[0]
    assert run["periods"] == 100
    assert run["missed_periods"] == own.record.missed
    assert run["torque"] == {
        "equal": True,
        "largest_difference": 0.0,
        "first_difference": None,
    }
    assert run["step_time_s"]["maximum"] == own.record.step.max()
    refused = replace(own, record=record([0.0], [1e-6], [1e-6])).values()
    assert refused["memory_locked"] is True
    assert refused["real_time_priority"] is False
    assert refused["priority_refusal"] == "Operation not permitted"


def test_table_names_the_machine_and_what_was_not_counted(report):
    text = report._repr_markdown_()
    assert str(report.machine) in text
    assert text.count("bit for bit") == 2
    uncounted = StepCosts(operations=9, instructions=None, stack_bytes=None, tools="no valgrind")
    run = replace(report.runs[0], costs=uncounted)
    (row,) = replace(report, runs=(run,)).rows()
    assert len(row) == len(TABLE_HEADER)
    assert row[4] == "not counted"
    assert run.values()["counted_with"] == "no valgrind"
