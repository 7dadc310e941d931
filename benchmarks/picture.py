"""Work against precision: the one picture that compares integrators fairly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from benchmarks.measure import Result


def draw(loops: Mapping[str, Sequence[Result]], terms: Sequence[Result], out: Path) -> Path:
    """Write benchmarks.png to `out` and return its path."""
    figure, axes = plt.subplots(1, len(loops) + 1, figsize=(15, 4.5), layout="constrained")
    for axis, (title, results) in zip(axes, loops.items(), strict=False):
        families: dict[str, list[Result]] = {}
        for result in results:
            families.setdefault(result.name.split(",")[0], []).append(result)
        for family, members in families.items():
            points = sorted((r.cost, r.error) for r in members if r.error)
            best = [p for p in points if not any(q[0] < p[0] and q[1] <= p[1] for q in points)]
            (line,) = axis.loglog(*zip(*best, strict=True), "o-", label=family)
            axis.loglog(*zip(*points, strict=True), ".", color=line.get_color())
        axis.set(title=title, xlabel="ms per simulated second", ylabel="largest force error (N)")
        axis.legend(fontsize=7)
        axis.grid(which="both", alpha=0.2)
    ordered = sorted(terms, key=lambda result: -result.cost)
    axes[-1].barh([r.name for r in ordered], [r.cost for r in ordered])
    axes[-1].set(xscale="log", title="Rigid-body terms", xlabel="ns per evaluation")
    out.mkdir(parents=True, exist_ok=True)
    path = out / "benchmarks.png"
    figure.savefig(path, dpi=130)
    plt.close(figure)
    return path
