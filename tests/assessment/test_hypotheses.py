"""Every hypothesis takes the status its data ask for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrac_design.assessment.hypotheses import assess
from mrac_design.assessment.mismatch import inertia_mismatch, posture_grid
from mrac_design.assessment.signals import AdaptationSignals, excitation, rms
from mrac_design.errors import ParameterError
from mrac_design.robot import build_dynamics
from mrac_design.simulation.scenario import load_scenario
from mrac_design.stability import Status
from mrac_design.study import run_study
from tests.assessment.conftest import shortened


def assessed(study, certificate):
    dynamics = build_dynamics(study.robot)
    postures = posture_grid(study.robot, slide=0.05, turn=0.1, points=2)
    mismatch = inertia_mismatch(
        dynamics, study.scenario.model_error, postures, condition_limit=100.0
    )
    return assess(study, variant="adaptive", window=4.0, certificate=certificate, mismatch=mismatch)


@pytest.fixture(scope="module")
def nominal(study, continuous):
    return assessed(study, continuous.certificate)


def test_nominal_run(nominal):
    status = {item.name: item.status for item in nominal.hypotheses}
    proved = {name for name, value in status.items() if value is Status.PROVED}
    assert proved == {
        "relative degree", "A and B coprime", "minimum phase", "sign of b0", "Ao and Am stable",
        "error model strictly positive real", "normalisation",
    }  # fmt: skip
    for name in ("b0 known", "augmented error", "gains inside the certified box", "no saturation",
                 "exact linearisation", "away from singular postures"):  # fmt: skip
        assert status[name] is Status.CHECKED, name
    assert status["persistent excitation"] is Status.VIOLATED
    assert status["no disturbance"] is Status.VIOLATED
    assert status["continuous time"] is Status.ASSUMED
    assert "| no disturbance | violated |" in nominal._repr_markdown_()


def test_signals_rebuilt_from_a_recording_are_the_controllers(nominal):
    for part in nominal.signals:
        # The recording is read as straight lines between milliseconds.
        gap = rms(part.augmented_error - part.rebuilt_error)
        assert gap < 0.1 * rms(part.augmented_error)
        # The gains' part and the heart's nearly cancel: that is what adapting achieves.
        assert rms(part.from_heart) > 5 * rms(part.augmented_error)


def test_without_a_heart_the_error_is_what_the_gains_cause(scenario, continuous):
    """A parametric motion of nothing: only the design's own error at the start is left."""
    still = replace(scenario.motion, source="parametric")
    base = shortened(replace(scenario, motion=still))
    study = run_study(base)
    silent = study.motion.displacement
    zero = replace(study.motion, displacement=replace(silent, coefficients=0 * silent.coefficients))
    found = assessed(replace(study, motion=zero), continuous.certificate)
    assert found["no disturbance"].status is Status.PROVED


def test_model_error_and_stiffness_are_violations(continuous):
    parameters = assessed(run_study(shortened(load_scenario("parameters"))), continuous.certificate)
    assert parameters["exact linearisation"].status is Status.VIOLATED
    # Corners of a coarse grid just miss the 25 % of the first joint's row.
    assert "up to 24.9 %" in parameters["exact linearisation"].evidence
    assert "enough" in parameters["exact linearisation"].evidence
    stiffer = assessed(run_study(shortened(load_scenario("stiffness"))), continuous.certificate)
    assert stiffer["b0 known"].status is Status.VIOLATED
    assert "true 1200" in stiffer["b0 known"].evidence


def test_a_faster_law_leaves_a_small_box_and_is_not_normalised(study, continuous):
    trajectory = study.trajectories["adaptive"]
    gains = trajectory.signals["adapted_gains"]
    moved = replace(
        gains, values=np.array(gains.values) * np.linspace(1, 1.3, len(gains.values))[:, None]
    )
    run = replace(trajectory, signals={**trajectory.signals, "adapted_gains": moved})
    gradient = replace(
        study.scenario, adaptation=replace(study.scenario.adaptation, law="gradient")
    )
    changed = replace(study, scenario=gradient, trajectories={"adaptive": run})
    found = assessed(changed, continuous.certificate)
    assert found["gains inside the certified box"].status is Status.VIOLATED
    assert found["normalisation"].status is Status.VIOLATED
    # Gains that were not used do not explain the recorded error.
    assert found["augmented error"].status is Status.VIOLATED


def test_saturation_is_seen(study, continuous):
    trajectory = study.trajectories["adaptive"]
    torque = trajectory.signals["torque"]
    peaks = np.array(torque.values)
    peaks[100, 0] = study.robot.motor_torque_limits[0]
    run = replace(
        trajectory, signals={**trajectory.signals, "torque": replace(torque, values=peaks)}
    )
    found = assessed(replace(study, trajectories={"adaptive": run}), continuous.certificate)
    assert found["no saturation"].status is Status.VIOLATED


def sinusoids(time, regressor):
    zero = np.zeros(len(time))
    return AdaptationSignals(
        axis="X", time=time, regressor=regressor, gains=np.ones((len(time), 5)),
        augmented_error=zero, rebuilt_error=zero, from_gains=zero,
    )  # fmt: skip


def test_gram_matrix_of_sinusoids_in_closed_form():
    time = np.linspace(0, 8, 8001)
    sizes = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    waves = sizes * np.sin(2 * np.pi * np.outer(time, [1, 2, 3, 4, 5]))
    found = excitation(sinusoids(time, waves), window=4.0)
    # Orthogonal over whole periods: eigenvalues a²/2.
    np.testing.assert_allclose(found.eigenvalues, np.tile(sizes**2 / 2, (5, 1)), rtol=1e-9)
    assert found.smallest == pytest.approx(0.5)
    waves[:, 4] = waves[:, 3]
    poor = excitation(sinusoids(time, waves), window=4.0)
    assert poor.smallest < 1e-12
    with pytest.raises(ParameterError, match="window"):
        excitation(sinusoids(time, waves), window=9.0)
