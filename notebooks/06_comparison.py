# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3 (ipykernel)
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Controllers compared
#
# The paper compares its controller with others by features. Here every controller runs on the
# same axis, with the same sensor, delay and motion: each is tuned by the same search with the same
# number of evaluations and judged on motions it was not tuned on.

# %%
import os
import tempfile
from pathlib import Path

import numpy as np
from IPython.display import Markdown

from mrac_design.comparison import (
    ComparisonStore,
    claims,
    comparison_specification,
    findings,
    load_specification,
    pareto_front,
    run_comparison,
)
from mrac_design.comparison.findings import measured_under
from mrac_design.report.figures_comparison import (
    error_ranking_figure,
    limit_distance_figure,
    pareto_figure,
)
from mrac_design.report.tables_comparison import (
    claim_table,
    condition_table,
    feature_table,
    largest_table,
    limit_assumptions,
    rms_table,
    tuning_table,
)
from mrac_design.simulation.scenario import load_scenario

chosen = Path(os.environ.get("MRAC_SCENARIO", ""))
if chosen.suffix == ".json":
    specification = load_specification(chosen)
    store = ComparisonStore(chosen.parent / "runs")
else:
    # Opened by hand: a small comparison of a few; `mrac compare` makes the whole one.
    specification = comparison_specification(
        load_scenario("reality"),
        budget=12,
        seeds=3,
        taking_part=("frozen_inverse", "mrac_inverse", "integral", "observer"),
    )
    store = ComparisonStore(Path(tempfile.mkdtemp()))
comparison = run_comparison(specification, store=store)
setting = specification.setting
Markdown(
    f"""The axis is the plant $K_s/(p(p + K_2))$ that exact linearisation leaves, with
$K_s$ = {setting.stiffness:g} N/m and $K_2$ = {setting.velocity_gain:g} 1/s. The controller runs at
{1 / setting.period:g} Hz with {setting.delay} sample(s) of delay on a force sensor with
{1e3 * setting.noise:g} mN of white noise and readings in steps of {1e3 * setting.resolution:g} mN.
Friction and errors of the robot's model are left out here: they are alike for all."""
)

# %% [markdown]
# ## The rules
#
# Minimised is the rms force error $y - F_d$ on the training motion, under steps of the reference.
# A tuning is admissible when one more sample of dead time, which no law knows of, does not more
# than double that error: simulated, so the rule is the same for linear and for adaptive laws. A
# global search (differential evolution) spends half of the evaluations, a simplex search the rest;
# what adapts is tuned last, after the controller it adapts.
# Laws that take heart or breathing rate as known are told it, motion by motion; the one that needs
# an ECG gets the instants of the beats. PI with learning is made for a fast inner velocity loop and
# may choose its $K_2$. The motion predictor's repetition over a whole breath would need thousands
# of registers at this rate; its internal model keeps the breath's first two harmonics. Certified
# controllers must show, for every tuning that would become their best, a Lyapunov function common
# to all gains in their box and all stiffnesses up to 1.5 times the design's, checked in exact
# arithmetic; bias and harmonics enter as bounded inputs.

# %%
condition_table(comparison)

# %%
tuning_table(comparison)

# %% [markdown]
# ## Table I, with numbers

# %%
feature_table(comparison)

# %%
error_ranking_figure(comparison)

# %%
rms_table(comparison)

# %%
largest_table(comparison)

# %% [markdown]
# ## The limit
#
# The command computed from a reading moves the force only after the delay and one sample. What of
# the motion cannot be predicted over that time from noisy readings is left by *any* linear causal
# controller. Its square is a quadratic form of the motion's autocovariance; it is assumed that

# %%
Markdown(limit_assumptions())

# %%
limit_distance_figure(comparison)

# %% [markdown]
# ## What the motion leaves against what the noise brings
#
# Residuals without noise rank nothing: whoever listens closely to the sensor follows the motion
# well and amplifies the noise.

# %%
pareto_figure(comparison)

# %% [markdown]
# ## What this says

# %%
Markdown("\n".join(f"- {sentence}" for sentence in findings(comparison)))

# %%
claim_table(comparison)

# %% [markdown]
# ## Checks of what this chapter says

# %%
for contestant in comparison.contestants:
    entry = comparison.entries[contestant.name]
    assert entry.tuning.evaluations == specification.budget  # the same for all
    for condition in comparison.conditions.judged:
        assert measured_under(comparison, contestant.name, condition.name).rms.size == (
            specification.seeds
        )
names = {contestant.name for contestant in pareto_front(comparison)}
for name in names:
    own = comparison.entries[name].judgement
    assert not any(
        other.judgement.motion_error < own.motion_error
        and other.judgement.amplification < own.amplification
        for other in comparison.entries.values()
    )
# Along the front, listening less to the sensor leaves more of the motion.
motion = np.array([limit.motion_error for limit in comparison.front])
noise = np.array([limit.amplification for limit in comparison.front])
assert (np.diff(motion) >= -1e-12).all()
assert (np.diff(noise) <= 1e-12).all()
assert claims(comparison)[-1].met  # no linear controller is below the limit of linear control
Markdown("All checks passed.")
