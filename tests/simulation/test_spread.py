"""Random cases stay within their bounds and depend on their generator alone."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from mrac_design.errors import ParameterError
from mrac_design.simulation.ensemble import generator
from mrac_design.simulation.spread import UniformSpread
from tests.simulation.small_systems import INITIAL_STATE, PARAMETER_VALUES, PARAMETERS, pushes


def spread(**changes):
    given = {
        "layout": PARAMETERS,
        "parameters": PARAMETER_VALUES,
        "factors": {"inertia": (0.8, 1.2), "damping": (0.5, 0.6)},
        "initial_state": INITIAL_STATE,
        "inputs": (pushes(), pushes(jump=-1.0)),
    }
    return UniformSpread(**{**given, **changes})


def test_factors_fill_their_bounds_and_the_rest_stays():
    cases = [spread()(run, generator(3, run)) for run in range(300)]
    factors = np.array([case.parameters for case in cases]) / PARAMETER_VALUES
    assert np.all(factors[:, 1] == 1.0)
    for column, low, high in ((0, 0.8, 1.2), (2, 0.5, 0.6)):
        assert low <= factors[:, column].min() < low + 0.05 * (high - low)
        assert high - 0.05 * (high - low) < factors[:, column].max() <= high
    jumps = {case.inputs.coefficients[0, 1, 0] for case in cases}
    assert jumps == {0.7, -0.8}


def test_case_depends_on_seed_and_number_only():
    again = pickle.loads(pickle.dumps(spread()))
    one, other = (sampler(0, generator(3, 17)) for sampler in (spread(), again))
    assert np.array_equal(one.parameters, other.parameters)
    different = spread()(0, generator(4, 17))
    assert not np.array_equal(one.parameters, different.parameters)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"factors": {"mass": (1, 1)}}, "inertia, gravity, damping"),
        ({"factors": {"inertia": (1.2, 0.8)}}, "low <= high"),
        ({"inputs": ()}, "at least one"),
    ],
)
def test_what_cannot_be_is_refused(change, message):
    with pytest.raises(ParameterError, match=message):
        spread(**change)
