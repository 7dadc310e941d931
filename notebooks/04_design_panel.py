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
# # Design panel
#
# Move a slider and let go: the design is solved anew, one force axis is simulated against the
# scenario's heart motion, and the picture follows. A value that cannot be is explained above the
# picture.
#
# Worth trying:
#
# - **$K_2$ to 0**: the low-frequency force error $\propto K_2 r_1/s_1$ vanishes.
# - **true $K_s$ up**: the poles (circles) wander, the error hardly changes, adaptive or not.
# - **$\hat\gamma$ to 0**: the adaptive controller becomes the frozen one.
# - **$\omega$ down**: the heart comes through, and the model lags behind the desired force.

# %%
import os

from mrac_design.simulation.scenario import load_scenario
from mrac_design.workbench.panel import design_panel

scenario = load_scenario(os.environ.get("MRAC_SCENARIO", "nominal"))
panel = design_panel(scenario)
panel

# %% [markdown]
# ## Checks of what this page says

# %%
from dataclasses import replace

import numpy as np

from mrac_design.workbench.view import design_view, initial_values

start = initial_values(scenario)
frozen = design_view(replace(start, adaptation_gain=0.0), scenario)
assert np.array_equal(
    frozen.trajectories["adaptive"]["force"], frozen.trajectories["frozen"]["force"]
)


def rms_without_adaptation(values):
    return design_view(values, scenario).tracking["frozen"].rms_model_error_N


fast = replace(start, velocity_gain=0.0)
slow = replace(start, bandwidth=start.bandwidth / 2, observer_pole=start.observer_pole / 2)
assert rms_without_adaptation(fast) <= rms_without_adaptation(start)
assert rms_without_adaptation(slow) > rms_without_adaptation(start)
assert not panel.message.value
