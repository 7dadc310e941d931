"""The measurements by section, each fit to run in a process of its own."""

from __future__ import annotations

from benchmarks.closed_loop import ensembles, single_runs
from benchmarks.measure import Result
from benchmarks.problem import five_joint_loop
from benchmarks.terms import rigid_body_terms


def measure_section(
    section: str, compiler: str, rounds: int, duration: float
) -> tuple[list[Result], list[str]]:
    """Results of a section, and what is to be said about them."""
    remarks: list[str] = []
    if section == "terms":
        return rigid_body_terms(compiler, rounds=rounds, say=remarks.append), remarks
    measure = single_runs if section == "single" else ensembles
    problem = five_joint_loop(duration)
    return measure(problem, compiler, rounds=rounds, say=remarks.append), remarks
