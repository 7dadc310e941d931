"""The fit finds beats, breathing and shapes of a motion it knows nothing about."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from mrac_design.errors import MotionFileError, ParameterError
from mrac_design.motion import VariableRhythm, find_model, read_model
from mrac_design.motion.fit_file import Fit, write_fit
from mrac_design.motion.fit_series import Recording, lag_one_correlation
from mrac_design.motion.fitting import fit_recording, main

from .tracks import slow_track, write_csv

RATE = 25.0
TRUE = find_model("heart_invivo_fit").with_seed(3)


@pytest.fixture(scope="module")
def fit() -> Fit:
    position = TRUE.displacement(np.arange(750) / RATE).value.T
    recording = Recording(position=position, frame_rate=RATE, training=600)
    return fit_recording(recording, name="again", source="a test", assumptions=(), seed=1)


def test_beats_and_breathing_are_found(fit: Fit) -> None:
    assert isinstance(TRUE.rhythm, VariableRhythm)
    onsets = TRUE.onsets(fit.onsets[-1] + 0.3)
    # A beat has no marked beginning: the found ones may all be off by the same time.
    lag = np.array([onset - onsets[np.argmin(np.abs(onsets - onset))] for onset in fit.onsets])
    assert fit.onsets.size >= onsets.size - 2
    assert np.std(lag[1:-1]) < 1.0 / RATE  # less than a frame
    assert fit.rhythm.mean_period == pytest.approx(np.diff(onsets).mean(), rel=0.03)
    assert fit.model.breathing.frequency == pytest.approx(TRUE.breathing.frequency, rel=0.01)


def test_shapes_carry_over_to_held_back_beats_and_guessed_times_do_not(fit: Fit) -> None:
    known, coasting, steady = fit.residuals
    # The random part of the true beats, a tenth or two of the variance, cannot be explained.
    assert known.held_back_explained[0] > 0.9
    assert known.held_back_explained.min() > 0.5
    assert (steady.training_rms > known.training_rms).all()
    assert (coasting.held_back_rms[[0, 2]] > known.held_back_rms[[0, 2]]).all()


def test_the_refitted_model_moves_like_the_true_one(fit: Fit) -> None:
    # Means over twenty motions against one: random beats leave a fifth.
    for name in ("rms_velocity", "rms_acceleration", "peak_to_peak"):
        ratio = getattr(fit.generated, name) / getattr(fit.recorded, name)
        np.testing.assert_allclose(ratio, 1.0, atol=0.35, err_msg=name)


def test_the_written_file_is_the_model(fit: Fit, tmp_path: Path) -> None:
    path = tmp_path / "again.toml"
    write_fit(fit, path)
    again = read_model(path)
    # Written to 1e-5 mm.
    np.testing.assert_allclose(again.coefficients, fit.model.coefficients, atol=5.1e-9)
    assert again.variation is not None
    np.testing.assert_allclose(again.variation.modes, fit.variation.modes, atol=5.1e-9)
    assert again.systole == pytest.approx(fit.model.systole, abs=1e-6)
    assert [item.name for item in tmp_path.iterdir()] == ["again.toml"]
    with pytest.raises(MotionFileError, match="cannot be written"):
        write_fit(fit, tmp_path / "none" / "a.toml")


def test_motion_without_beats_or_too_short_is_refused() -> None:
    for position in (slow_track(100, RATE), np.zeros((750, 3))):
        with pytest.raises(ParameterError):
            fit_recording(
                Recording(position=position * 1e-3, frame_rate=RATE, training=80),
                name="n",
                source="s",
                assumptions=(),
                seed=1,
            )
    with pytest.raises(ParameterError, match="training"):
        Recording(position=np.zeros((50, 3)), frame_rate=RATE, training=50)


def test_the_command_says_what_is_wrong_and_writes_nothing(tmp_path: Path) -> None:
    track = write_csv(tmp_path / "short.csv", slow_track(100, RATE))
    app = typer.Typer()
    app.command()(main)
    result = CliRunner().invoke(app, [str(track), "--out", str(tmp_path / "m.toml")])
    assert result.exit_code == 2
    assert not (tmp_path / "m.toml").exists()


def test_correlation_of_an_alternating_sequence() -> None:
    assert lag_one_correlation(np.array([1.0, -1.0] * 20)) == -0.95
    assert abs(lag_one_correlation(np.random.default_rng(1).normal(size=4000))) < 0.05
