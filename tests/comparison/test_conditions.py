from __future__ import annotations

import numpy as np
import pytest

from mrac_design.comparison.conditions import condition_set
from mrac_design.comparison.setting import Condition, Periods, of_degree
from mrac_design.errors import MotionFileError, ParameterError
from mrac_design.motion import constant_force, find_model
from mrac_design.simulation.scenario import MotionChoice


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """750 frames of a motion with beats of 1.18 s on average, as a file."""
    t = np.arange(750) / 25.0
    position = 1e3 * find_model("heart_invivo_fit").displacement(t).value.T
    path = tmp_path_factory.mktemp("motion") / "heart.csv"
    rows = ["frame,p4_x_mm,p4_y_mm,p4_z_mm"]
    rows += [f"{i},{x:.6f},{y:.6f},{z:.6f}" for i, (x, y, z) in enumerate(position)]
    path.write_text("\n".join(rows))
    return MotionChoice(source=str(path), frame_rate=25.0, point="p4", cutoff=8.0)


@pytest.fixture(scope="module")
def recorded(setting, recording):
    return condition_set(setting, recording, axis="Z", stiffness_factor=1.5, stranger_count=0)


def test_frames_601_to_750_are_held_back(recorded):
    training, held_back = recorded.training, recorded.judged[0]
    assert training.duration == pytest.approx(24.0)
    assert held_back.settling == pytest.approx(24.0)
    assert held_back.duration == pytest.approx(749 / 25)
    t = np.linspace(0.0, 23.9, 50)
    assert np.allclose(training.heart(t), held_back.heart(t), atol=1e-12)


def test_beats_of_a_recording_are_found(recorded):
    model = find_model("heart_invivo_fit")
    assert recorded.training.periods.beat == pytest.approx(model.rhythm.mean_period, rel=0.05)
    # The phase a beat is said to begin at is another than the model's, but stays the same.
    found, true = recorded.training.beats[3:15], model.onsets(30.0)
    lag = np.array([instant - true[true <= instant][-1] for instant in found])
    assert lag.std() < 0.15  # the beats themselves vary by 0.11 s
    ages = recorded.judged[0].beat_age()(np.arange(5.0, 20.0, 0.01))[0]
    assert ages.min() < 0.02
    assert ages.max() == pytest.approx(np.diff(recorded.training.beats).max(), rel=0.1)


def test_only_the_stiffness_is_another(recorded):
    held_back, stiffer = recorded.judged[:2]
    assert (held_back.stiffness_factor, stiffer.stiffness_factor) == (1.0, 1.5)
    assert np.array_equal(held_back.heart.coefficients, stiffer.heart.coefficients)


def test_a_model_is_held_back_by_its_random_numbers(conditions):
    t = np.linspace(6.0, 23.0, 100)
    training, held_back = conditions.training, conditions.judged[0]
    assert np.abs(training.heart(t) - held_back.heart(t)).max() > 1e-4


def test_strangers_are_what_their_names_say(conditions):
    named = {c.name: c for c in conditions.judged}
    assert named["fast"].periods.beat == 0.5
    intervals = np.diff(named["ectopic"].beats)
    short = named["ectopic"].beats[int(np.argmin(intervals))]
    assert intervals.min() == pytest.approx(0.65 * 0.8)
    assert named["ectopic"].settling < short < named["ectopic"].duration
    late = np.linspace(15.0, 29.0, 2000)  # without breathing every beat is the same
    apnoea = named["apnoea"].heart
    assert np.allclose(apnoea(late), apnoea(late + 0.8), atol=1e-8)
    # The random motion has the training motion's size.
    power = conditions.spectrum.power.sum()
    sample = named["random"].heart(np.arange(0, 30, 0.01))[0]
    assert np.mean(sample**2) == pytest.approx(power, rel=0.7)


def test_ages_start_where_the_last_beat_would_be(conditions):
    condition = conditions.training
    heart, reference = condition.heart, constant_force(1.0).piecewise(condition.duration)
    given = Condition(
        name="x", title="x", heart=heart, reference=reference, beats=np.array([0.3, 1.2]),
        periods=Periods(beat=0.9, breath=4.0), stiffness_factor=1.0, settling=1.0,
    )  # fmt: skip
    assert np.allclose(given.beat_age()([0.0, 0.2, 0.4, 1.3])[0], [0.6, 0.8, 0.1, 0.1])


def test_errors(setting, conditions):
    missing = MotionChoice(source="nowhere.csv", frame_rate=25.0, point="p4", cutoff=8.0)
    with pytest.raises(MotionFileError):
        condition_set(setting, missing, axis="Z", stiffness_factor=1.5)
    with pytest.raises(ParameterError, match="below the signal's own"):
        of_degree(conditions.training.heart, 1)
