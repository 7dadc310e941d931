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
# # Plant, design and what is proved
#
# ## What the force controller sees
#
# After exact linearisation each force axis is a double integrator with a velocity loop,
# $\ddot X = u - K_2\dot X$, in contact with the heart through a spring, $F_e = K_s(X - X_h)$.
# From command to force that is
#
# $$G(p) = \frac{K_s}{p\,(p + K_2)},$$
#
# where $p$ is the differential operator. ([Z] prints $1/(p(p+K_2))$ and leaves $K_s$ out.) The
# motion of the heart enters as a disturbance at the output, $d = -K_s X_h$.

# %%
import os

import numpy as np
from IPython.display import Markdown, display

from mrac_design.design import design_rst_exact, diophantine_system
from mrac_design.plant import ForcePlant
from mrac_design.polynomials.rationals import coefficients, polynomial_latex
from mrac_design.report import (
    Table,
    loop_figure,
    pole_figure,
    realness_figure,
    sensitivity_figure,
)
from mrac_design.simulation.scenario import load_scenario
from mrac_design.stability import (
    augmented_error_argument,
    factorisations,
    feedforward_theorem,
    positive_real,
    second_opinion,
    strictly_positive_real,
)
from mrac_design.study import scenario_design
from mrac_design.verdict import Verdict

scenario = load_scenario(os.environ.get("MRAC_SCENARIO", "nominal"))
design = scenario_design(scenario)
specification = design.specification
plant, model = specification.plant, specification.reference_model
plant

# %% [markdown]
# The reference model says how the force shall answer its command [Z 10]:

# %%
model

# %% [markdown]
# ## The Diophantine equation
#
# The controller $R\,u = -S\,y + T\,u_c$ with $R = (p + r_1) D$, $S = s_0 p^n + \dots + s_n$,
# $T = t_0 p^n + \dots + t_n$ makes the loop behave like the model $A_m$, seen through an observer
# polynomial $A_o$ of degree $n$, when
#
# $$A R + b_0 S = A_o A_m, \qquad T = \frac{\omega^2}{b_0} A_o , \qquad b_0 = K_s ,$$
#
# with $A = p(p + K_2)$. $D$, of degree $n - 1$, is an internal model of the heart's motion
# [AW section 3.2]; the paper's controller [Z 7–9] has none: $D = 1$, $A_o = p + a_o$. Compared
# power by power this is a linear system for $r_1, s_0, \dots, s_n$ with one solution, in the
# paper's case
#
# $$r_1 = 2\xi\omega + a_o - K_2,\quad s_0 = \frac{2\xi\omega a_o + \omega^2 - K_2 r_1}{b_0},\quad
#   s_1 = t_1 = \frac{a_o\omega^2}{b_0},\quad t_0 = \frac{\omega^2}{b_0}.$$
#
# The program solves the system numerically and again over the rationals, and checks both.

# %%
Markdown(
    f"Here $A_o = {polynomial_latex(specification.observer, 'p')}$ and "
    f"$D = {polynomial_latex(specification.internal_model, 'p')}$."
)

# %%
design

# %%
system = diophantine_system(specification)
exact = design_rst_exact(specification)
K2, b0, omega, xi = plant.velocity_gain, plant.b0, model.bandwidth, model.damping
if specification.degree == 1:
    ao = specification.observer_pole
    r1 = 2 * xi * omega + ao - K2
    s0 = (2 * xi * omega * ao + omega**2 - K2 * r1) / b0
    expected, name = [r1, s0, ao * omega**2 / b0, omega**2 / b0, ao * omega**2 / b0], "closed form"
else:
    r1 = float(exact.R[specification.degree - 1]) - specification.internal_model[1]
    expected, name = [r1, *coefficients(exact.S), *coefficients(exact.T)], "rational solution"
deviation = max(
    abs(value - other) / unit
    for (_, value, _), other, unit in zip(
        design.coefficients, expected, design.scaling, strict=True
    )
)
Markdown(
    f"Largest deviation from the {name}, in the units of $\\Sigma$ below: {deviation:.1e}. The "
    f"relative residual of the Diophantine equation is {design.residual:.1e}; over the rationals "
    f"it is exactly {exact.remainder}."
)

# %% [markdown]
# ## The loop with its gains frozen
#
# Without adaptation this is an ordinary linear controller. It is the yardstick for everything the
# adaptation is said to buy, and stands beside the adaptive controllers in all results.

# %%
pole_figure(design)

# %%
design.margins()

# %%
loop_figure(design)

# %%
sensitivity_figure(design)

# %% [markdown]
# The heart's motion reaches the force through $S_d = p(p+K_2)(p+r_1)/(A_oA_m)$. At the low
# frequencies of a heart
#
# $$e \approx -\left(\frac{K_2 r_1}{s_1}\dot X_h + \frac{K_2 + r_1}{s_1}\ddot X_h\right),$$
#
# in which the true stiffness of the tissue does not appear: a frozen controller passes a test of
# changed stiffness about as well as an adaptive one.


# %%
def force_per_motion(true_stiffness, frequency):
    """|e/Xh| (N/m) of the frozen controller at a frequency (rad/s) on tissue of any stiffness."""
    p = 1j * frequency
    AR = np.polyval(plant.A, p) * np.polyval(design.R, p)
    return abs(true_stiffness * AR / (AR + true_stiffness * np.polyval(design.S, p)))


beat = 2 * np.pi * 1.0
stiffnesses = np.array([0.5, 1.0, 1.5]) * plant.stiffness
responses = np.array([force_per_motion(Ks, beat) for Ks in stiffnesses])
slow = 1j * beat * K2 * design.r1 - beat**2 * (K2 + design.r1)
approximation = abs(slow * np.polyval(specification.internal_model, 1j * beat)) / design.S[-1]
Table(
    caption="Force error for heart motion at 1 Hz with frozen gains, derived.",
    header=("true stiffness (N/m)", "force error per motion (mN/mm)"),
    rows=(
        *((f"{Ks:g}", f"{r:.4g}") for Ks, r in zip(stiffnesses, responses, strict=True)),
        ("low-frequency formula", f"{approximation:.4g}"),
    ),
    numeric=(1,),
)

# %% [markdown]
# ## Adaptation
#
# The gains $\theta = (r_1 - c,\ s_0, \dots, s_n,\ t_0, \dots, t_n)$ move with the augmented error
# $\varepsilon$,
#
# $$u = -\tfrac{K}{A_o}u - \theta^{\mathsf T}(P_1\varphi),\qquad
#   \varepsilon = e + b_0\eta,\quad e = y - y_m,\quad
#   \eta = -\left(\tfrac{(p + c)D}{P_1A_o}u + \varphi^{\mathsf T}\theta\right),$$
#
# with $Q = A_oA_m$, $P_1 = A_m$, $P_2 = A_o$ and $\varphi$ made of filtered $u$, $y$ and $u_c$. $c$
# makes the two highest powers of $(p + c)D$ those of $A_o$, and $K = (p + c)D - A_o$. Without
# internal model $c = a_o$, $K = 0$ and this is [AW 5.71, Example 5.14]. ([Z] calls its rule the MIT
# rule; it is [AW 5.62].) In natural units the gains differ by orders of magnitude and one scalar
# adaptation gain cannot serve them all. Scaled by $\theta = \Sigma\hat\theta$ with a diagonal
# $\Sigma$, in the paper's case
# $\mathrm{diag}(\omega,\ \omega^2/b_0,\ \omega^3/b_0,\ \omega^2/b_0,\ \omega^3/b_0)$, and
# $\hat\varphi = b_0 \Sigma\varphi$, they are of order one.

# %%
adaptation = scenario.adaptation
LAWS = {
    "gradient": r"$\dot{\hat\theta} = \hat\gamma\,\omega\,\hat\varphi\,\varepsilon$",
    "normalised": r"$\dot{\hat\theta} = \hat\gamma\,\omega\,\hat\varphi\,\varepsilon\,/\,"
    r"(\alpha + \hat\varphi^{\mathsf T}\hat\varphi)$",
}
display(
    Markdown(
        f"This study uses the {adaptation.law} law {LAWS[adaptation.law]} with "
        rf"$\hat\gamma = {adaptation.gain:g}$ and $\alpha = {adaptation.normalisation:g}$ N², "
        "assumed; zero gain gives back the frozen controller."
    )
)
Table(
    caption="Nominal gains, the start of the adaptation.",
    header=("gain", "natural units", r"$\Sigma$", r"scaled $\hat\theta$"),
    rows=tuple(
        (
            "$r_1 - c$" if name == "r1" else f"${name[0]}_{{{name[1:]}}}$",
            f"{natural:.6g} {unit}",
            f"{size:.4g}",
            f"{scaled:.4g}",
        )
        for (name, _, unit), natural, size, scaled in zip(
            design.coefficients,
            design.parameters,
            design.scaling,
            design.scaled_parameters,
            strict=True,
        )
    ),
    numeric=(1, 2, 3),
)

# %% [markdown]
# ## What is proved, and what is not
#
# [Z] states that the loop is asymptotically stable and refers to a theorem of [AW]. **That does not
# follow.** Theorem 5.9 of [AW] adapts one *feedforward* gain in front of a *stable* $G = G_1G_2$
# whose part $G_1$ is strictly positive real. Here all gains adapt, in the paper's case five, of
# which three are in the *feedback* path, around a plant that integrates, under a disturbance that
# the theorem does not have. Hypothesis by hypothesis, decided in exact arithmetic where it can be:

# %%
c = 0.8 * K2 if K2 > 0 else 0.1 * omega
table = factorisations(
    plant.stiffness, K2, filter_zero=c, bandwidth=model.bandwidth, damping=model.damping
)
plant_function = ForcePlant(stiffness=plant.stiffness, velocity_gain=K2).transfer_function()
plant_judgement = positive_real(plant_function)
theorem = feedforward_theorem(table.rows[0], plant_judgement)
theorem

# %% [markdown]
# ### Which splittings of the plant are strictly positive real
#
# $G_1$ is *positive real* when its phase never leaves ±90° and it has no unstable poles;
# *strictly* so when this still holds with the imaginary axis moved a little to the left. The
# table decides both over the rationals, for a filter $p + c$ where one is used.

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
# The plant alone has relative degree two, so no splitting with $G_2 = 1$ can work. A strictly
# positive real $G_1$ that leaves the integrator to $G_2$ leaves there a $G_2$ that is not strictly
# stable: **none of the splittings of this plant is covered**. The adaptation law above avoids the
# question: its error model is the constant $b_0$, which is trivially strictly positive real.
#
# python-control is asked for a second opinion on *positive* realness. It solves a semidefinite
# program with a tolerance and does not test strictness, so it confirms but does not decide.

# %%
opinions = [second_opinion(row.positive) for row in table.rows]
ANSWERS = {True: "passive", False: "not passive", None: "no answer"}
Table(
    caption="Exact verdict on positive realness of $G_1$, and python-control's.",
    header=("splitting", "exact", "python-control", "remark"),
    rows=tuple(
        (row.name, row.positive.verdict.value, ANSWERS[opinion.passive], opinion.note)
        for row, opinion in zip(table.rows, opinions, strict=True)
    ),
)

# %% [markdown]
# ### What does hold for this loop
#
# With $\varepsilon = b_0\varphi^{\mathsf T}(\theta^0 - \theta)$ and
# $V = \tfrac12\tilde\theta^{\mathsf T}\Gamma^{-1}\tilde\theta$ one finds
# $\dot V = -\varepsilon^2/b_0 \le 0$: the gains stay bounded and $\varepsilon$ is square
# integrable. Bounded signals and $e \to 0$ need the normalised law and a further argument. All of
# this is for a heart that does not move; with a moving heart, boundedness of this loop is **not
# proved here**.

# %%
error_model = strictly_positive_real([plant.b0], [1.0])
lyapunov = augmented_error_argument(plant_judgement, error_model)
lyapunov

# %% [markdown]
# ## Checks of what this chapter says
#
# Numerical, exact and closed-form gains agree; the loop is stable; at 1 Hz the low-frequency
# formula holds for every stiffness; the verdicts on the splittings are those the formulas for
# $K_2$, $c$ and $2\xi\omega$ predict, and no splitting is covered by the theorem.

# %%
assert deviation < 1e-12
assert design.residual <= 1e-12
assert exact.remainder == 0
assert np.all(design.closed_loop_poles.real < 0)
# The formula leaves out terms of the order of frequency over bandwidth, and all that Ks changes.
late = specification.observer[-2] / specification.observer[-1] + 2 * xi / omega
assert np.allclose(responses, approximation, rtol=3 * beat * late)
assert theorem.verdict is Verdict.REFUTED
assert not any(row.usable for row in table.rows if row.second is not None)
strict = [row.strict.verdict is Verdict.PROVED for row in table.rows]
assert strict == [K2 > 0, K2 > 0, False, True, False, 0 < c < 2 * xi * omega]
assert table.rows[4].positive.verdict is Verdict.REFUTED
assert not any(row.second_stable for row in table.rows[:2])
assert error_model.verdict is Verdict.PROVED
assert lyapunov.verdict is not Verdict.PROVED
Markdown("All checks passed.")
