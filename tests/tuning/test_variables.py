from __future__ import annotations

import pytest

from mrac_design.errors import ParameterError
from mrac_design.simulation.scenario import load_scenario
from mrac_design.tuning.variables import VARIABLES, placed, position_of, read_variables, values_at


def test_ends_of_the_ranges_are_reached_exactly():
    variables = tuple(VARIABLES.values())
    assert values_at(variables, [0.0] * 4) == tuple(v.low for v in variables)
    assert values_at(variables, [1.0] * 4) == tuple(v.high for v in variables)


@pytest.mark.parametrize("name", VARIABLES)
def test_value_and_position_undo_each_other(name):
    variable = VARIABLES[name]
    for position in (0.13, 0.5, 0.77):
        value = variable.value(position)
        # Three significant digits of a range of at most four decades.
        assert variable.position(value) == pytest.approx(position, abs=5e-3)
        assert variable.value(variable.position(value)) == value


def test_values_have_few_digits():
    assert VARIABLES["gain"].value(0.123456789) == float(
        f"{VARIABLES['gain'].value(0.123456789):.3g}"
    )
    assert VARIABLES["k2"].value(0.123456789) == 24.7


def test_placed_changes_the_chosen_numbers_only():
    base = load_scenario("nominal")
    changed = placed(base, read_variables("k2,gain,ao,alpha"), (1.0, 2.0, 300.0, 0.5))
    assert changed.design.velocity_gain == 1.0
    assert changed.adaptation.gain == 2.0
    assert changed.design.observer_pole == 300.0
    assert changed.adaptation.normalisation == 0.5
    own = [v.read(base) for v in VARIABLES.values()]
    assert placed(changed, tuple(VARIABLES.values()), own) == base


def test_values_outside_a_range_start_at_its_end():
    variables = read_variables("k2=0:10,ao=600:900")
    assert list(position_of(variables, (50.0, 500.0))) == [1.0, 0.0]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("k2,omega", "'omega' is none of k2, gain, ao, alpha"),
        ("k2,k2", "k2 is named twice"),
        ("ao=300", "must be written low:high"),
        ("ao=300:x", "must be written low:high"),
        ("ao=900:300", "low < high"),
        ("ao=-1:300", "0 <= low"),
        ("", "'' is none of"),
    ],
)
def test_mistakes_in_one_sentence(text, problem):
    with pytest.raises(ParameterError, match=problem):
        read_variables(text)
