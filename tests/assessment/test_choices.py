"""Choices are read strictly."""

from __future__ import annotations

import pytest
from flint import fmpq

from mrac_design.assessment.choices import choices_path, load_choices
from mrac_design.errors import ScenarioFileError


def altered(tmp_path, old, new):
    text = choices_path("paper").read_text()
    assert old in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(old, new, 1))
    return path


def test_packaged_choices():
    choices = load_choices("paper")
    assert choices.tissue == (800, 1200)
    assert choices.sampled.timing.period == fmpq(1, 1000)
    assert len(choices.map.samplings) == 4


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("softest", "soft", r"tissue.*soft"),
        ("delays = [0, 1, 1, 1]", "delays = [0, 1]", "needs 4"),
        ("delay = 1 ", "delay = 1.5 ", "whole numbers, got 1.5"),
        ("noise_growth = 1.25", "noise_growth = 0.5", "noise_growth"),
    ],
)
def test_mistakes_are_named(tmp_path, old, new, message):
    with pytest.raises(ScenarioFileError, match=message):
        load_choices(altered(tmp_path, old, new))


def test_an_unknown_name_lists_those_there_are():
    with pytest.raises(ScenarioFileError, match="paper"):
        load_choices("nothing")
