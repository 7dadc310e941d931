from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from mrac_design.comparison.comparison import contestants
from mrac_design.comparison.setting import Periods
from mrac_design.controller.disturbance_observer import with_disturbance_observer
from mrac_design.controller.reference import LeadingInverse, ModelInverse
from mrac_design.design import ReferenceModel
from mrac_design.errors import ParameterError

ALL = {contestant.name: contestant for contestant in contestants()}
PERIODS = Periods(beat=1.0, breath=5.0)


def observed(setting, delay, drive=0.05):
    inner = ALL["frozen_inverse"].build(setting, PERIODS, ALL["frozen_inverse"].start).step
    return inner, with_disturbance_observer(
        inner, plant=setting.plant, domain=setting.domain, delay=delay, drive=drive,
        force_noise=5e-3,
    )  # fmt: skip


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_rest_stays_rest(setting, delay):
    _, step = observed(setting, delay)
    p = step.parameter_values
    rest = step.equilibrium(1.5, p)
    assert float(step.command(rest, 1.5, 1.5, p)) == pytest.approx(0.0, abs=1e-9)
    following = step.advance(rest, 1.5, 1.5, 0.0, p)[0]
    assert following.shape == (step.state.size, 1)
    assert np.allclose(following.full(), rest.full(), atol=1e-12)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_a_constant_disturbance_is_found_and_cancelled(setting, delay):
    """A plain loop: a constant acceleration pushes, the command comes to oppose it."""
    _, step = observed(setting, delay)
    p, disturbance = step.parameter_values, 0.3
    A = np.zeros((3, 3))
    A[0, 1], A[1] = 1.0, [0.0, -setting.velocity_gain, setting.stiffness]
    held = expm(A * setting.period)
    force, state = np.array([1.0, 0.0]), step.equilibrium(1.0, p)
    pending = [0.0] * delay
    for _ in range(1500):
        command = float(step.command(state, force[0], 1.0, p))
        state = step.advance(state, force[0], 1.0, command, p)[0]
        pending.append(command)
        force = held[:2, :2] @ force + held[:2, 2] * (pending.pop(0) + disturbance)
    assert force[0] == pytest.approx(1.0, abs=1e-4)
    assert command == pytest.approx(-disturbance, rel=1e-3)
    estimate = step.state.split(state.full().ravel())["estimate"]
    assert estimate[2] == pytest.approx(disturbance, rel=1e-3)


def test_errors(setting):
    with pytest.raises(ParameterError, match="drive"):
        observed(setting, 1, drive=0.0)
    preview = ALL["preview"].build(setting, PERIODS, ALL["preview"].start).step
    with pytest.raises(ParameterError, match="force only"):
        with_disturbance_observer(
            preview, plant=setting.plant, domain=setting.domain, delay=1, drive=0.1,
            force_noise=5e-3,
        )  # fmt: skip
    with pytest.raises(ParameterError, match="lead"):
        LeadingInverse(-1.0)


def test_the_inverse_leads():
    model = ReferenceModel(bandwidth=300.0, damping=0.8)
    assert LeadingInverse(0.0).weights(model) == pytest.approx(ModelInverse().weights(model))
    lead, w = 2e-3, 2.0  # at 2 rad/s the third-order terms left out come to 3e-7
    c1, c2 = LeadingInverse(lead).weights(model)
    answered = (1 + c1 * 1j * w - c2 * w**2) / (1 + 1.6j * w / 300 - (w / 300) ** 2)
    assert answered == pytest.approx(np.exp(1j * w * lead), abs=1e-6)
