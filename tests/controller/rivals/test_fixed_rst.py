"""RST with fixed gains: closed form with an integrator, poles, disturbances, no windup."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrac_design.controller.rivals.fixed_rst import fixed_rst
from mrac_design.design import ReferenceModel, RSTSpecification, design_rst
from mrac_design.plant import ForcePlant
from mrac_design.time_domain import Discrete
from tests.controller.rivals.cases import RST, STIFFNESS, VELOCITY_GAIN
from tests.oracles import sampled_force_loop as loop

SPECIFICATION = RST.design.specification


@settings(max_examples=30, deadline=None)
@given(
    Ks=st.floats(100, 5000),
    K2=st.one_of(st.just(0.0), st.floats(0.1, 300)),
    ω=st.floats(50, 900),
    ξ=st.floats(0.4, 2),
    ωo=st.floats(50, 900),
    ξo=st.floats(0.4, 2),
)
def test_coefficients_have_the_closed_form(Ks, K2, ω, ξ, ωo, ξo):
    design = design_rst(
        RSTSpecification(
            plant=ForcePlant(stiffness=Ks, velocity_gain=K2),
            reference_model=ReferenceModel(bandwidth=ω, damping=ξ),
            observer=(1.0, 2 * ξo * ωo, ωo**2),
            internal_model=(1.0, 0.0),
        )
    )
    α1, α2 = 2 * ξo * ωo, ωo**2
    r1 = α1 + 2 * ξ * ω - K2
    S = [α2 + 2 * ξ * ω * α1 + ω**2 - K2 * r1, 2 * ξ * ω * α2 + α1 * ω**2, α2 * ω**2]
    # The solver's residual may be 1e-10 of Ao Am.
    np.testing.assert_allclose(design.R, [1, r1, 0], rtol=1e-7, atol=1e-7 * (α1 + ω))
    np.testing.assert_allclose(design.S, np.array(S) / Ks, rtol=1e-6, atol=1e-7 * abs(S[0]) / Ks)
    np.testing.assert_allclose(design.T, ω**2 / Ks * np.array([1, α1, α2]), rtol=1e-7)


def test_the_continuous_loop_has_the_poles_of_ao_and_am():
    rows, command = fixed_rst(RST).matrices()
    system = fixed_rst(RST).feedback()
    A = np.array([[0.0, 1.0], [0.0, -VELOCITY_GAIN]])
    b, c = np.array([0.0, STIFFNESS]), np.array([1.0, 0.0])
    closed = np.block(
        [
            [A + np.outer(b, c) * system.D[0, 0], np.outer(b, system.C[0])],
            [np.outer(system.B[:, 0], c), system.A],
        ]
    )
    wanted = np.concatenate(
        [
            np.roots(SPECIFICATION.reference_model.polynomial),
            np.roots(SPECIFICATION.observer),
            [-50, -50],
        ]
    )
    found = np.poly(np.linalg.eigvals(closed))
    np.testing.assert_allclose(found, np.poly(wanted), rtol=1e-8)
    assert command.size == rows.shape[0] + 3


def test_a_constant_push_at_the_input_leaves_no_error():
    h = 2e-4
    rows, command = fixed_rst(replace(RST, time_domain=Discrete(h))).matrices()
    phi, gamma = loop.plant(STIFFNESS, VELOCITY_GAIN, h)
    forces = loop.run(
        rows, command, phi, gamma, 0,
        disturbance=np.full(2500, 1.3), reference=np.zeros(2500),
        state=np.zeros(rows.shape[0]), plant_state=[0, 0],
    )  # fmt: skip
    assert np.abs(forces).max() > 1e-2
    assert abs(forces[-1]) < 1e-12


def test_a_command_limit_does_not_wind_it_up():
    h, limit = 1e-3, 3.0
    controller = fixed_rst(replace(RST, time_domain=Discrete(h)))
    rows, command = controller.matrices()
    phi, gamma = loop.plant(STIFFNESS, VELOCITY_GAIN, h)
    state, x = np.zeros(rows.shape[0]), np.array([0.0, 0.0])
    forces = []
    for k in range(3000):
        push = -6.0 if k < 600 else 0.0  # twice the limit: the tip is carried away meanwhile
        columns = np.concatenate([state, [x[0], 1.0, 0.0]])
        columns[-1] = np.clip(command @ columns, -limit, limit)
        state, x = rows @ columns, phi @ x + gamma * (columns[-1] + push)
        forces.append(x[0])
    back = np.array(forces[600:])
    # Coming back under the same limit cannot overshoot more than the loop's own step would.
    assert back.max() < 1.0 + 0.4 * abs(back.min() - 1.0)
    assert back[-1] == pytest.approx(1.0, abs=1e-6)
