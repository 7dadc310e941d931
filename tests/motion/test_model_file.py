"""Motion model files: strict reading."""

from __future__ import annotations

from pathlib import Path

import pytest

from mrac_design.errors import MotionFileError
from mrac_design.motion import available_motions, load_motion, read_model
from mrac_design.resources import models_directory

MOTIONS = models_directory() / "motions"


def test_models_are_found_by_name_and_by_path(tmp_path: Path) -> None:
    assert {"heart_invivo_fit", "parametric", "parametric_fast"} <= set(available_motions())
    copy = tmp_path / "mine.toml"
    copy.write_text((MOTIONS / "parametric.toml").read_text())
    assert load_motion(copy, duration=2.0).peak_to_peak.tolist() == (
        load_motion("parametric", duration=2.0).peak_to_peak.tolist()
    )
    for missing in ("parametrik", tmp_path / "none.toml", tmp_path / "a.csv"):
        with pytest.raises(MotionFileError, match="heart_invivo_fit, parametric"):
            load_motion(missing, duration=2.0)


@pytest.mark.parametrize("name", available_motions())
def test_every_packaged_model_states_source_and_assumptions(name: str) -> None:
    model = read_model(MOTIONS / f"{name}.toml")
    assert model.source
    assert model.assumptions
    text = " ".join((model.source, *model.assumptions)).lower()
    assert "pig" not in text
    assert "porcine" not in text


CHANGES = [
    ("parametric", "mean_period = 0.8", "mean_periode = 0.8", "mean_period"),
    ("parametric", "mean_period = 0.8", "mean_period = -0.8", "mean_period"),
    ("parametric", "mean_period = 0.8", 'mean_period = "fast"', "rhythm.mean_period"),
    ("parametric", "frequency = 0.25", "frequency = 0.0", "breathing frequency"),
    ("parametric", "seed = 1", "seed = 1.5", "seed"),
    ("parametric", 'unit = "mm"', 'unit = "inch"', "unit"),
    ("parametric", 'origin = "assumed"', 'origin = "recorded"', "origin"),
    ("parametric", 'kind = "regular"', 'kind = "random"', "kind"),
    ("parametric", 'kind = "regular"\n', "", "rhythm.kind"),
    ("parametric", "respiratory = [1.0, 0.2]", "respiratory = [1.0]", "respiratory_phase"),
    ("parametric", "cardiac = [1.20, 0.70,", "cardiac = [nan, 0.70,", "cardiac"),
    ("parametric", "[amplitudes.Y]", "[amplitudes.W]", "amplitudes.W"),
    ("parametric_ectopic", "beat = 4", "beat = 4.5", "beat"),
    ("parametric_ectopic", 'based_on = "parametric"', 'based_on = "nothing"', "based_on"),
    ("parametric_apnoea", "fade = 1.0", "", "breathing.fade"),
    ("heart_invivo_fit", "correlations = [", "correlations = [0.1, ", "correlations"),
    ("heart_invivo_fit", "Z = [\n", "Z = [\n    [0.1, 0.2],\n", "coefficients.Z"),
    ("heart_invivo_fit", "assumptions = [", "assumptions = [3, ", "assumptions"),
]


@pytest.mark.parametrize(("name", "old", "new", "place"), CHANGES)
def test_a_spoilt_file_is_one_error_at_its_key(
    name: str, old: str, new: str, place: str, tmp_path: Path
) -> None:
    text = (MOTIONS / f"{name}.toml").read_text()
    assert old in text
    path = tmp_path / "spoilt.toml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(MotionFileError) as caught:
        read_model(path)
    assert place in str(caught.value)
    assert str(path) in str(caught.value)
