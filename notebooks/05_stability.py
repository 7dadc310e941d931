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
# # Is the adaptive loop stable?
#
# [Z] calls its adaptive force controller asymptotically stable and refers to [AW]. This report
# says what that theorem covers, what it does not, what can be proved instead, and how hard
# simulation has tried to break it. Three words are kept apart throughout: **proved** is decided by
# exact computation over the rationals, **checked** was seen to hold in a computation that is no
# proof, and **assumed** is taken for granted.

# %%
import json
import math
import os
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from IPython.display import Markdown, display

from mrac_design.assessment.adaptive_runs import adaptive_runs, motion_responses
from mrac_design.assessment.advisor import advise_gain
from mrac_design.assessment.choices import load_choices
from mrac_design.assessment.designs import (
    continuous_design,
    map_of_designs,
    remedies,
    sampled_design,
    tolerated_mismatches,
    without_projection,
)
from mrac_design.assessment.hypotheses import assess
from mrac_design.assessment.mismatch import inertia_mismatch, posture_grid
from mrac_design.assessment.prediction import (
    FAST,
    delay_prediction,
    noise_prediction,
    sampled_prediction,
    step_prediction,
)
from mrac_design.assessment.worst_case import WorstCases, worst_cases
from mrac_design.report import Table, realness_figure, torque_figure
from mrac_design.report.figures_stability import (
    advice_figure,
    bounds_figure,
    box_figure,
    error_split_figure,
    excitation_figure,
    map_figure,
    mismatch_figure,
    region_figure,
)
from mrac_design.robot import build_dynamics
from mrac_design.simulation.scenario import load_scenario
from mrac_design.stability import (
    Status,
    augmented_error_argument,
    candidate_conditions,
    certified_loop,
    factorisations,
    feedforward_theorem,
    positive_real,
    search_factorisations,
    strictly_positive_real,
    write_certificate,
)
from mrac_design.study import run_study
from mrac_design.verdict import Verdict
from mrac_design.verify import verify_certificate

scenario = load_scenario(os.environ.get("MRAC_SCENARIO", "nominal"))
choices = load_choices(os.environ.get("MRAC_STABILITY", "paper"))
study = run_study(scenario)
axes = study.robot.force_axes
plant, model = study.plant, study.design.specification.reference_model
K2, omega, xi = plant.velocity_gain, model.bandwidth, model.damping
degree = study.design.specification.degree
published = continuous_design(without_projection(scenario), choices)
practical = sampled_design(without_projection(scenario), choices)
designs = (published, practical)
proved = [item for item in designs if item.certificate.verdict is Verdict.PROVED]

plant_judgement = positive_real(plant.transfer_function())
c = 0.8 * K2 if K2 > 0 else 0.1 * omega
table = factorisations(plant.stiffness, K2, filter_zero=c, bandwidth=omega, damping=xi)
theorem = feedforward_theorem(table.rows[0], plant_judgement)

# %%
lines = [
    "**In short.** "
    + (
        "The asymptotic stability that [Z] claims is *not* covered by Theorem 5.9 of [AW]: "
        if theorem.verdict is not Verdict.PROVED
        else "Theorem 5.9 of [AW] covers this loop: "
    )
    + "the theorem adapts one feedforward gain of a stable plant without disturbance, the loop "
    f"adapts {2 * degree + 3} gains, {degree + 2} of them in the feedback path, around a plant "
    "that integrates, on a heart that moves.",
    "",
    "What is proved instead: when the feedback gains are kept in a box by projection, the loop is "
    "exponentially stable for *every* path of the gains inside it and of the tissue's stiffness "
    f"between {choices.softest:g} and {choices.stiffest:g} N/m, and the force that the heart "
    "causes has a certified bound.",
    "",
]
for item in designs:
    certificate = item.certificate
    verdict = certificate.verdict.value
    text = f"- {item.title}, gains within ±{100 * item.share:g} %: **{verdict}**"
    if certificate.verdict is Verdict.PROVED:
        text += (
            f", any deviation dies out with a time constant of {1e3 / certificate.decay_rate:.3g} "
            "ms, and "
            + (
                f"1 m/s² of heart acceleration costs at most {certificate.peak_gain:.3g} N"
                if certificate.peak is not None
                else "no peak bound of the force was found"
            )
        )
    else:
        text += f": {certificate.reason}"
    lines.append(text + ".")
Markdown("\n".join(lines))

# %% [markdown]
# ## What the theorem of the literature covers
#
# Theorem 5.9 of [AW] is about an augmented error in front of a stable $G = G_1G_2$ with $G_1$
# strictly positive real. Hypothesis by hypothesis, for the loop of [Z]:

# %%
theorem

# %% [markdown]
# The adaptation law of this loop has an argument of its own. With
# $\varepsilon = b_0\varphi^{\mathsf T}(\theta^0-\theta)$ and
# $V = \tfrac12\tilde\theta^{\mathsf T}\Gamma^{-1}\tilde\theta$ one finds $\dot V =
# -\varepsilon^2/b_0$: bounded gains and a square-integrable $\varepsilon$, as far as its own
# hypotheses hold.

# %%
error_model = strictly_positive_real([plant.b0], [1.0])
lyapunov = augmented_error_argument(plant_judgement, error_model)
lyapunov

# %% [markdown]
# ## Positive realness
#
# ### The splittings of the plant
#
# The table lists the splittings of $G = K_s/(p(p+K_2))$ that come up in the literature, with the
# verdict on $G_1$ decided over the rationals.

# %%
display(
    Markdown(
        f"Filter zero $c$ = {c:g} 1/s, $K_2$ = {K2:g} 1/s, $2\\xi\\omega$ = {2 * xi * omega:g}."
    )
)
table

# %%
realness_figure(table.rows, bandwidth=np.sqrt(max(K2, 1.0) * omega))

# %% [markdown]
# ### All splittings
#
# A search over every way to deal out poles and gain, with a filter $p + c$ on either side or none:

# %%
searched = search_factorisations(plant.transfer_function(), filter_zeros=[-c])
usable = [row for row in searched.rows if row.usable]
display(
    Markdown(
        f"{len(searched.rows)} splittings, **{len(usable)}** of them usable "
        "($G_1$ strictly positive real *and* $G_2$ strictly stable)."
    )
)
Table(
    caption="Every splitting with a proper $G_2$.",
    header=("$G_1 \\cdot G_2$", "$G_1$ positive real", "strictly", "$G_2$ stable"),
    rows=tuple(
        (
            row.name,
            row.positive.verdict.value,
            row.strict.verdict.value,
            "yes" if row.second_stable else "no",
        )
        for row in searched.rows
    ),
)

# %% [markdown]
# ### In symbols
#
# For positive letters each condition is necessary and sufficient.

# %%
conditions = candidate_conditions()
values = {
    "K2": K2,
    "omega": omega,
    "xi": xi,
    "ao": study.design.specification.observer_pole,
    "c": c,
}


def here(condition):
    if K2 == 0 and "K2" in condition.name:
        return "$K_2 = 0$ is not positive"
    return "holds" if condition.holds({k: str(v) for k, v in values.items()}) else "does not hold"


Table(
    caption="When a factor or an error model is strictly positive real.",
    header=("function", "condition", f"here, $c$ = {c:g} 1/s"),
    rows=tuple(
        (
            condition.name,
            f"${condition.latex()}$",
            here(condition),
        )
        for condition in conditions
    ),
)

# %%
region_figure(study.design)

# %% [markdown]
# ## The hypotheses, one by one
#
# For the adaptive controller of this scenario in the simulated run: what a proof of asymptotic
# stability would need, and how it stands. Regressor and augmented error are rebuilt here from the
# recorded force and command alone.

# %%
dynamics = build_dynamics(study.robot)
limit = scenario.simulation.condition_limit
where = choices.mismatch
near = posture_grid(study.robot, slide=where.near_slide, turn=where.near_turn, points=where.points)
far = posture_grid(study.robot, slide=where.far_slide, turn=where.far_turn, points=where.points)
own_mismatch = inertia_mismatch(dynamics, scenario.model_error, near, condition_limit=limit)
assessment = assess(
    study,
    variant="adaptive",
    window=min(choices.window, scenario.simulation.duration - scenario.simulation.settling),
    certificate=published.certificate,
    mismatch=own_mismatch,
)
assessment

# %%
counts = {status: sum(h.status is status for h in assessment.hypotheses) for status in Status}
Markdown(
    ", ".join(f"{count} {status.value}" for status, count in counts.items())
    + ". One violated hypothesis is enough for the classical argument not to apply; those that "
    "are only assumed would have to be secured by the installation."
)

# %%
excitation_figure(assessment)

# %%
error_split_figure(assessment.signals)

# %%
box_figure(assessment, published.certificate)

# %%
torque_figure(study)

# %% [markdown]
# ## What is proved instead
#
# With $u = -\theta^{\mathsf T}(P_1\varphi)$ each force axis is linear in its state for any path of
# the gains, and its matrix is affine in $r_1'$, $s_0$, $s_1$ and $K_s$. A quadratic function
# $V = x^{\mathsf T}Px$ that decreases at every corner of box × stiffness range decreases for every
# path between them: whatever the adaptation does, be it driven by noise, by the heart or by a
# programming error in its gain, the loop is exponentially stable as long as the gains stay in the
# box. A semidefinite program proposes $P$; it is rounded to rationals, and every inequality is
# then decided in exact arithmetic. Only that second step gives the verdict.

# %%
for item in designs:
    display(Markdown(f"### {item.title[0].upper()}{item.title[1:]}"))
    display(item.certificate)
    display(certified_loop(item.certificate))

# %%
Markdown(
    "The certificate's matrices are those of the controller that runs and is exported: its "
    "derivatives at every corner of the box agree with them to "
    + " and ".join(f"{item.gap:.1e} ({item.title})" for item in designs)
    + ", relative to the largest entry."
)

# %% [markdown]
# ### What the bound means for this heart
#
# The heart enters as one acceleration, $d = \ddot X_h + K_2\dot X_h$. The certified peak gain times
# $\sup|d|$ bounds the force the motion causes; the simulation beside it runs the adaptive law,
# projected to its box, on the same motion at zero force reference. What follows the reference
# comes on top.

# %%
bounded = [item for item in proved if item.certificate.peak is not None]
responses = {
    item.title: motion_responses(
        item.certificate,
        item.scenario,
        item.design,
        displacement=study.motion.displacement.selected(study.robot.task.position),
        axes=axes,
    )
    for item in bounded
}
Table(
    caption=f"Force caused by the motion {study.motion.name}: certified bound and simulation.",
    header=(
        "design",
        "axis",
        "$\\sup\\lvert d\\rvert$ (m/s²)",
        "bound (N)",
        "simulated (N)",
        "ratio",
    ),
    rows=tuple(
        (
            title,
            axis,
            f"{r.peak_disturbance:.3g}",
            f"{r.bound:.3g}",
            f"{r.simulated:.3g}",
            f"{r.bound / r.simulated:.3g}",
        )
        for title, found in responses.items()
        for axis, r in found.items()
    ),
    numeric=(2, 3, 4, 5),
)

# %% [markdown]
# The guarantee is for the worst path of the gains and the worst heart within the envelope, so it
# lies above what this heart does; how far, the next section says.
#
# ## Hostile simulation
#
# Gains and stiffness jump at will between points of the box: by chance, or chosen backwards in
# time by an adversary who knows the certificate. The disturbance is the worst for that very path.
# In the last row of each table the gains are moved by the law itself, from random starts in the
# box, for several $\hat\gamma$, on random stiffness and random hearts. No simulated value may
# exceed its bound.

# %%
hostile = choices.hostile
cases = {}
for item in proved:
    tried = worst_cases(
        item.certificate, paths=hostile.paths, spans=hostile.spans, seed=hostile.seed
    )
    comparisons = list(tried.comparisons)
    if item in bounded:
        comparisons.append(
            adaptive_runs(
                item.certificate,
                item.scenario,
                item.design,
                gains=hostile.gains,
                runs=hostile.runs,
                seed=hostile.seed,
            )
        )
    cases[item.title] = WorstCases(comparisons=tuple(comparisons))
    display(Markdown(f"**{item.title[0].upper()}{item.title[1:]}**"))
    display(cases[item.title])

# %%
if cases:
    display(bounds_figure(cases))

# %% [markdown]
# ## The robot's model is never exact
#
# On the real robot the axes couple through an error of its inertial parameters:
# $\ddot X = (1 + \Delta)f^*$ with $\Delta = M_x^{-1}\hat M_x - 1$. The certificate tolerates every
# $\Delta$, in all axes at once and along any path of postures, up to a norm that is **proved**; the
# norm that a parameter error really causes is **checked** on a grid of postures. The wider the box
# of the gains, the less mismatch is tolerated: the two have to be chosen together.

# %%
paper_error = load_scenario("parameters").model_error
five = replace(paper_error, first_joint_scale=1.0)
certificates = tolerated_mismatches(published, choices)
found = {
    "5 % on every body": (
        inertia_mismatch(dynamics, five, near, condition_limit=limit),
        inertia_mismatch(dynamics, five, far, condition_limit=limit),
    ),
    "5 %, and 25 % on the first joint": (
        inertia_mismatch(dynamics, paper_error, near, condition_limit=limit),
        inertia_mismatch(dynamics, paper_error, far, condition_limit=limit),
    ),
}
counted = {len(pair[0].norms) for pair in found.values()}
display(
    Table(
        caption="Mismatch that a parameter error causes, **checked** on the postures given, and "
        "the acceleration that its error of gravity adds.",
        header=("error of the model", "postures", "largest mismatch", "gravity error (m/s²)"),
        rows=tuple(
            (name, f"{len(m.norms)} {place}", f"{100 * m.largest:.3g} %", f"{m.gravity.max():.3g}")
            for name, pair in found.items()
            for place, m in zip(("around home", "across the workspace"), pair, strict=True)
        ),
        numeric=(2, 3),
    )
)


# %%
def covers(certificate, name):
    """Whether the tolerated mismatch is above what is caused, near and far."""
    if certificate.verdict is not Verdict.PROVED:
        return "not certified"
    near_far = [m.largest <= certificate.tolerated_mismatch for m in found[name]]
    return {(True, True): "yes", (True, False): "around home", (False, False): "no"}.get(
        tuple(near_far), "no"
    )


Table(
    caption="Mismatch tolerated by the continuous design, **proved**, for boxes of several sizes; "
    "whether it covers what was found on the postures above, and the certified peak gain.",
    header=("box", "tolerated", *(f"covers {name}" for name in found), "peak gain (N/(m/s²))"),
    rows=tuple(
        (
            f"±{100 * box:g} %",
            f"{100 * certificate.tolerated_mismatch:.3g} %",
            *(covers(certificate, name) for name in found),
            f"{certificate.peak_gain:.3g}" if certificate.peak is not None else "not found",
        )
        for box, certificate in zip(choices.mismatch.boxes, certificates, strict=True)
    ),
    numeric=(1, 4),
)

# %%
mismatch_figure(*found["5 %, and 25 % on the first joint"], certificates)

# %% [markdown]
# ## Which designs can be certified at all
#
# Bandwidth, sample rate and computational delay against the largest certified box, a guide for
# choosing all three:

# %%
design_map = map_of_designs(scenario, choices)
map_figure(design_map)

# %%
advice = []
if choices.sampled.timing in design_map.samplings:
    advice = remedies(
        design_map, bandwidth=omega, timing=choices.sampled.timing, fraction=choices.sampled.box
    )
Markdown(
    f"For ±{100 * choices.sampled.box:g} % at $\\omega$ = {omega:g} rad/s on the processor "
    "chosen:\n\n" + "\n".join(f"- {sentence}" for sentence in advice)
)

# %% [markdown]
# ## How large the adaptation gain may be
#
# Under a constant force adaptation is one mode of speed
# $\lambda = \hat\gamma\omega\lvert\hat\varphi_0\rvert^2$ (over
# $\alpha + \lvert\hat\varphi_0\rvert^2$ for the normalised law): a hidden integral action that
# takes phase, needs a fine enough step, and lets noise through. Each bound on $\hat\gamma$ is the
# largest that still meets the requirement; for the processor it comes from the poles of the
# controller's code itself.

# %%
advices = {}
for item in designs:
    timing = None if item is published else choices.sampled.timing
    box = item.certificate.box if item.certificate.verdict is Verdict.PROVED else None
    advices[item.title] = advise_gain(
        item.scenario, item.design, choices.needs, sampled=timing, box=box
    )
    a = advices[item.title]
    display(Markdown(f"### {item.title[0].upper()}{item.title[1:]}"))
    display(a)
    text = (
        f"The {a.law} law of this scenario has $\\hat\\gamma$ = {a.chosen:g} "
        f"($\\lambda$ = {a.speed:.3g} 1/s at {choices.needs.largest_force:g} N); "
        f"the least bound is {a.largest_gain:.3g}, from the {a.binding.source}: "
        + ("**within it**." if a.chosen <= a.largest_gain else "**beyond it**.")
    )
    if a.box is not None:
        names = item.design.specification.gain_names[: len(a.box.lower)]
        ends = zip((f"{n[0]}_{n[1:]}" for n in names), a.box.lower, a.box.upper, strict=True)
        text += " Project the scaled gains to " + ", ".join(
            f"${name} \\in [{low:.4g}, {high:.4g}]$" for name, low, high in ends
        )
        text += (
            f". Without projection, noise of {1e3 * choices.needs.noise_rms:g} mN alone would "
            f"take them out of that box in about {a.time_to_border:.3g} s at zero force."
            if math.isfinite(a.time_to_border)
            else "."
        )
    display(Markdown(text))

# %% [markdown]
# ### The advisor's predictions, tried
#
# Each limit is tried in the nonlinear simulation on both sides, with the plain gradient law, whose
# speed has no ceiling: a kick of a micrometre must die out just inside and grow just outside.

# %%
force = choices.needs.largest_force
base = published.scenario
delays = [
    delay_prediction(base, published.design, speed=0.0, force=force, name="dead time, frozen"),
    delay_prediction(
        base, published.design, speed=500.0, force=force, name="dead time, λ = 500 1/s"
    ),
    delay_prediction(
        base, published.design, speed=FAST, force=force, name=f"dead time, λ = {FAST:g} 1/s"
    ),
]
predictions = [
    *delays,
    step_prediction(base, published.design, choices.needs),
    sampled_prediction(practical.scenario, practical.design, choices.needs, choices.sampled.timing),
]


def shown(value, unit):
    return f"{1e3 * value:.3g} ms" if unit == "s" else f"{value:.3g} {unit}"


def growth(value):
    return f"{value:.3g}" if math.isfinite(value) else "died out" if value < 0 else "diverged"


Table(
    caption="Limits predicted from the linearised loop, and growth measured in simulation.",
    header=(
        "limit",
        "predicted",
        "tried inside",
        "growth (1/s)",
        "tried outside",
        "growth (1/s)",
        "confirmed",
    ),
    rows=tuple(
        (
            p.name,
            shown(p.predicted, p.unit),
            shown(p.inside, p.unit),
            growth(p.inside_growth),
            shown(p.outside, p.unit),
            growth(p.outside_growth),
            "yes" if p.confirmed else "**no**",
        )
        for p in predictions
    ),
    numeric=(1, 2, 3, 4, 5),
)

# %%
advice_figure(published.design, delays, choices.needs.noise_growth)

# %%
noises = [
    noise_prediction(base, published.design, choices.needs, speed=speed)
    for speed in (0.0, 500.0, FAST)
]
Table(
    caption=f"Force noise from {1e3 * choices.needs.noise_rms:g} mN rms in the sensor.",
    header=("$\\lambda$ (1/s)", "predicted (mN)", "simulated (mN)"),
    rows=tuple(
        (f"{n.speed:g}", f"{1e3 * n.predicted:.3g}", f"{1e3 * n.simulated:.3g}") for n in noises
    ),
    numeric=(0, 1, 2),
)

# %% [markdown]
# ## What may be said, and what not
#
# Computed from the results above.

# %%
violated = [h.name for h in assessment.hypotheses if h.status is Status.VIOLATED]
tight = min((c_.ratio for found_ in cases.values() for c_ in found_.comparisons), default=math.nan)
said = [
    "**Not covered:** asymptotic stability by Theorem 5.9 of [AW]. Violated: "
    + "; ".join(h.name for h in theorem.hypotheses if not h.holds)
    + ".",
    "**Not proved here:** that the error goes to zero on a moving heart. It does not; the heart "
    "leaves an error that is bounded, not zero."
    if "no disturbance" in violated
    else "**Not proved here:** that the error goes to zero.",
    "**Not proved:** that the gains converge to their true values; "
    + (
        "without persistent excitation they need not, and in this run they do not."
        if "persistent excitation" in violated
        else "they may in this run, which is excited well enough."
    ),
]
said += [
    f"**Proved** ({item.title}): exponential stability and a bounded force for every path of "
    f"the gains within ±{100 * item.share:g} % and of the stiffness between "
    f"{choices.softest:g} and {choices.stiffest:g} N/m."
    for item in proved
]
said += [
    f"**Checked:** nothing simulated exceeded a certified bound; the closest came to within a "
    f"factor {tight:.3g}.",
    "**Assumed in every certificate:** the gains are projected to the box, torques stay within "
    "their limits, a bias adds nothing to the disturbance that is not counted in it, and each axis "
    "is linearised: up to the mismatch proved above in continuous "
    "time, exactly in the sampled certificate.",
]
Markdown("\n".join(f"- {line}" for line in said))

# %% [markdown]
# ## Checks of what this chapter says
#
# The certificates are written out and judged once more by the checker that imports neither the
# designer nor a solver. For the packaged scenario and choices every claim has to be met.

# %%
results = Path(os.environ.get("MRAC_RESULTS") or tempfile.mkdtemp())
reports = {}
for item, name in zip(designs, ("continuous", "sampled"), strict=True):
    if item in proved:
        path = results / f"certificate_{name}.json"
        write_certificate(item.certificate, path)
        reports[name] = verify_certificate(path)
        assert reports[name].accepted
        assert item.certificate.verify() is None
assert theorem.verdict is Verdict.REFUTED
assert not usable
assert error_model.verdict is Verdict.PROVED
assert all(item.gap < 1e-12 for item in designs)  # products of a few rounded numbers
assert all(not tried.exceeded for tried in cases.values())
assert all(r.simulated <= r.bound for group in responses.values() for r in group.values())
assert counted == {len(near)} or own_mismatch.left_out > 0
for n in noises:
    assert abs(n.simulated / n.predicted - 1) < 0.15  # 20 s of noise, and its spectrum is not flat
holds = {condition.name: condition for condition in conditions}
assert holds["(p + c)/Am"].holds({k: str(v) for k, v in values.items()}) == (c < 2 * xi * omega)


def finite(value):
    return value if math.isfinite(value) else None


summary = {
    "scenario": scenario.name,
    "choices": choices.name,
    "theorem_5_9": theorem.verdict.value,
    "designs": {
        item.title: {
            "verdict": item.certificate.verdict.value,
            "box": item.share,
            "decay_rate_1_per_s": item.certificate.decay_rate,
            "peak_gain_N_per_m_per_s2": finite(item.certificate.peak_gain),
            "energy_gain_N_per_m_per_s2": finite(item.certificate.energy_gain),
            "bound_over_simulated": {
                comparison.name: comparison.ratio
                for comparison in (cases[item.title].comparisons if item in proved else ())
            },
        }
        for item in designs
    },
    "mismatch": {
        name: {"around_home": pair[0].largest, "workspace": pair[1].largest}
        for name, pair in found.items()
    },
    "tolerated_mismatch": {
        f"{box:g}": certificate.tolerated_mismatch
        for box, certificate in zip(choices.mismatch.boxes, certificates, strict=True)
    },
    "hypotheses": {h.name: h.status.value for h in assessment.hypotheses},
    "largest_gain": {title: finite(a.largest_gain) for title, a in advices.items()},
    "predictions_confirmed": {p.name: p.confirmed for p in predictions},
}
(results / "values.json").write_text(json.dumps(summary, indent=2, ensure_ascii=False) + "\n")

if scenario == load_scenario("nominal") and choices == load_choices("paper"):
    assert len(proved) == 2
    assert all(p.confirmed for p in predictions)
    assert assessment["persistent excitation"].status is Status.VIOLATED
    assert assessment["no disturbance"].status is Status.VIOLATED
    assert assessment["no saturation"].status is Status.CHECKED
    assert assessment["gains inside the certified box"].status is Status.CHECKED
Markdown("All checks passed.")
