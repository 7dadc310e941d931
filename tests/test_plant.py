from __future__ import annotations

import math

import control
import numpy as np
import pytest

from mrac_design.errors import NotCausalError, ParameterError
from mrac_design.plant import ForcePlant, Process
from mrac_design.time_domain import Continuous, Discrete


def test_force_plant_is_stiffness_over_double_pole():
    plant = ForcePlant(stiffness=800.0, velocity_gain=50.0)
    s = 3.0 + 20.0j
    # One division on each side: a few roundings.
    assert plant.transfer_function()(s) == pytest.approx(800.0 / (s * (s + 50.0)), rel=1e-14)
    assert plant.process.transfer_function()(s) == pytest.approx(
        800.0 / (s * (s + 50.0)), rel=1e-14
    )
    np.testing.assert_array_equal(plant.A, [1.0, 50.0, 0.0])
    np.testing.assert_array_equal(plant.B, [1.0])
    assert plant.b0 == 800.0


def test_force_plant_from_python_control():
    system = control.tf([1600.0], [2.0, 100.0, 0.0])
    assert ForcePlant.from_transfer_function(system) == ForcePlant(
        stiffness=800.0, velocity_gain=50.0
    )


@pytest.mark.parametrize(
    "system",
    [
        control.tf([1.0, 2.0], [1.0, 3.0, 0.0]),
        control.tf([1.0], [1.0, 3.0, 1.0]),
        control.tf([1.0], [1.0, 3.0]),
        control.tf([1.0], [1.0, 3.0, 0.0], dt=0.1),
    ],
)
def test_other_transfer_functions_are_not_force_plants(system):
    with pytest.raises(ParameterError, match="Ks/"):
        ForcePlant.from_transfer_function(system)


@pytest.mark.parametrize("stiffness", [0.0, -800.0, math.nan, math.inf])
def test_stiffness_must_be_positive(stiffness):
    with pytest.raises(ParameterError, match=f"stiffness Ks = {stiffness}.*positive"):
        ForcePlant(stiffness=stiffness, velocity_gain=50.0)


@pytest.mark.parametrize("velocity_gain", [-1e-9, -50.0, math.nan, math.inf])
def test_velocity_gain_must_not_be_negative(velocity_gain):
    with pytest.raises(ParameterError, match=f"K2 = {velocity_gain}"):
        ForcePlant(stiffness=800.0, velocity_gain=velocity_gain)


def test_velocity_gain_may_be_zero():
    assert ForcePlant(stiffness=800.0, velocity_gain=0.0).process.A[1] == 0


@pytest.mark.parametrize("dt", [0, 0.02])
def test_process_round_trip_through_python_control(dt):
    system = control.tf([0.5, 0.25], [1.0, -0.3, 0.7], dt=dt)
    process = Process.from_transfer_function(system)
    back = process.transfer_function()
    np.testing.assert_array_equal(back.num[0][0], system.num[0][0])
    np.testing.assert_array_equal(back.den[0][0], system.den[0][0])
    assert back.dt == dt
    assert process.domain == (Discrete(0.02) if dt else Continuous())
    assert process.relative_degree == 1


def test_process_must_be_causal_and_scalar():
    with pytest.raises(NotCausalError, match=r"deg B = 2 > deg A = 1"):
        Process.of(A=[1, 2], B=[1, 0, 3], domain=Continuous())
    with pytest.raises(ParameterError, match="degree of A"):
        Process.of(A=[3], B=[1], domain=Continuous())
    with pytest.raises(ParameterError, match="without input"):
        Process.of(A=[1, 2], B=[0], domain=Continuous())
    two_inputs = control.tf([[[1.0], [2.0]]], [[[1.0, 1.0], [1.0, 2.0]]])
    with pytest.raises(ParameterError, match="one of each"):
        Process.from_transfer_function(two_inputs)


def test_latex_of_plants():
    assert "p + 50" in ForcePlant(stiffness=800.0, velocity_gain=50.0)._repr_latex_()
    process = Process.of(A=[1, "-1.5", "0.5"], B=[1], domain=Discrete(1.0))
    assert r"q^{2} - \tfrac{3}{2}\,q + \tfrac{1}{2}" in process._repr_latex_()
