from __future__ import annotations

import math

import pytest

from mrac_design.errors import ParameterError
from mrac_design.time_domain import Continuous, Discrete, time_domain_of


def test_time_bases_of_python_control():
    assert time_domain_of(0) == Continuous()
    assert time_domain_of(0.001) == Discrete(0.001)
    assert time_domain_of(1) == Discrete(1.0)


@pytest.mark.parametrize("dt", [None, True])
def test_time_base_without_period_is_refused(dt):
    with pytest.raises(ParameterError, match="period"):
        time_domain_of(dt)


@pytest.mark.parametrize("period", [0.0, -1.0, math.nan, math.inf])
def test_period_must_be_positive(period):
    with pytest.raises(ParameterError, match="sampling period"):
        Discrete(period)


def test_discrete_root_stands_for_a_continuous_mode():
    s = Discrete(0.1).equivalent_pole(math.e**-0.2)
    assert s == pytest.approx(-2.0, abs=1e-14)
    assert Discrete(0.1).equivalent_pole(0.0).real == -math.inf
    # A negative real root is an oscillation at the Nyquist frequency.
    assert Discrete(0.1).equivalent_pole(-0.5).imag == pytest.approx(math.pi / 0.1)


def test_stability_regions_are_open():
    assert not Continuous().is_stable(0.0)
    assert Continuous().is_stable(-1e-300)
    assert not Discrete(1.0).is_stable(-1.0)
    assert Discrete(1.0).is_stable(0.999)
