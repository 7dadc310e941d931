"""Contact laws against closed forms of a mass pressed on them."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrac_design.errors import ParameterError
from mrac_design.motion import StepSequence
from mrac_design.motion.signal import PiecewisePolynomial
from mrac_design.simulation.contact import (
    Contact,
    LinearSpring,
    OneSided,
    ScheduledTissue,
    Touch,
    WithDamper,
    retreating,
)
from tests.simulation.point_mass import constant, pressed_mass

SPRING = LinearSpring(800.0)


def force_of(contact: Contact, *, depth: float, velocity: float = 0.0, **inputs: float) -> float:
    values = {name: ca.SX(ca.DM(value)) for name, value in contact.values(1).items()}
    given_inputs = {name: ca.SX(value) for name, value in inputs.items()}
    touch = Touch(
        depth=ca.SX(depth), velocity=ca.SX(velocity), inputs=given_inputs, parameters=values
    )
    return float(ca.evalf(contact.force(touch)))


def test_kelvin_voigt_creeps_as_its_closed_form():
    """x(t) of m ẍ + c ẋ + Ks x = F from rest: the overdamped step response."""
    mass, damping, push = 0.05, 20.0, 1.0
    run = pressed_mass(
        WithDamper(tissue=SPRING, damping=damping),
        mass=mass, push=push, heart=constant(0.0, 0.3),
    )  # fmt: skip
    a, b = np.roots([mass, damping, 800.0])
    t = run["time"]
    expected = push / 800.0 * (1 + (b * np.exp(a * t) - a * np.exp(b * t)) / (a - b))
    # RK4 at 0.1 ms on a pole of 354 1/s is wrong by (λh)⁴/120 ≈ 1e-8 of 1.25 mm.
    np.testing.assert_allclose(run["position"], expected, atol=1e-10)
    assert expected[-1] == pytest.approx(push / 800.0, rel=1e-3)


def test_the_damper_feels_the_heart_move_too():
    """At the heart's own speed the damper is silent, whatever that speed."""
    speed = 0.03
    heart = PiecewisePolynomial(
        breakpoints=np.array([0.0, 0.2]), coefficients=np.array([[[0.0, speed]]])
    )
    contact = WithDamper(tissue=SPRING, damping=20.0)
    run = pressed_mass(contact, mass=1.0, push=1.0, heart=heart, start=1.0 / 800.0, speed=speed)
    np.testing.assert_allclose(run["force"], 1.0, atol=1e-12)  # rounding only


@given(
    depth=st.floats(-5e-3, 5e-3),
    velocity=st.floats(-1.0, 1.0),
    heart_velocity=st.floats(-1.0, 1.0),
    damping=st.floats(0.0, 100.0),
)
def test_one_sided_tissue_never_pulls(depth, velocity, heart_velocity, damping):
    inner = WithDamper(tissue=SPRING, damping=damping)
    given_ = {"depth": depth, "velocity": velocity, "heart_velocity": heart_velocity}
    force, within = force_of(OneSided(tissue=inner), **given_), force_of(inner, **given_)
    assert force >= 0.0
    assert force == (within if depth > 0 and within > 0 else 0.0)


def test_contact_is_lost_and_found_again():
    """A mass thrown off the tissue flies freely, and lands with the speed it left with."""
    mass, push, speed = 1.0, 2.0, -0.4
    run = pressed_mass(
        OneSided(tissue=SPRING), mass=mass, push=push, heart=constant(0.0, 0.6),
        start=0.0, speed=speed, step=1e-5,
    )  # fmt: skip
    flight = -2 * speed * mass / push  # 0.4 s of free fall
    t = run["time"]
    free = (t > 0) & (t < flight - 1e-3)
    assert np.all(run["force"] >= 0.0)
    assert np.all(run["force"][free] == 0.0)
    np.testing.assert_allclose(
        run["position"][free], speed * t[free] + push / mass * t[free] ** 2 / 2, atol=1e-12
    )
    later = t > flight + 1e-3
    energy = mass * run["velocity"] ** 2 / 2 + 400 * np.maximum(run["depth"], 0) ** 2
    energy -= push * run["position"]
    # The kink costs RK4 its order for one step of 10 µs: 400 (v h)² = 6e-9 J of 0.08 J.
    np.testing.assert_allclose(energy, mass * speed**2 / 2, rtol=1e-6)
    assert np.max(run["force"][later]) > 5.0


def test_a_stiffness_step_leaves_the_position_where_it_is():
    factor = StepSequence(times=(0.0, 0.1), levels=(1.0, 1.5))
    contact = ScheduledTissue(tissue=SPRING, factor=factor)
    run = pressed_mass(contact, mass=1.0, push=1.0, heart=constant(0.0, 0.2), start=1.0 / 800.0)
    before, after = run["time"] < 0.0995, run["time"] > 0.0995
    np.testing.assert_allclose(run["force"][before], 1.0, atol=1e-12)
    np.testing.assert_allclose(run["force"][after], 1200 * run["depth"][after], rtol=1e-12)
    assert run["force"][100] == pytest.approx(1.5, rel=1e-12)  # at the very instant
    # From rest, 0.5 N on 1 kg: the mass moves by a h²/2 in the first millisecond, not at once.
    assert run["position"][100] == pytest.approx(1.0 / 800.0, abs=1e-15)
    assert abs(run["position"][101] - run["position"][100]) < 0.5 * 1e-6 / 2 * 1.001
    # Then it swings about push / 1200 with the frequency of the stiffer tissue.
    t = run["time"][after] - 0.1
    expected = 1 / 1200 + (1 / 800 - 1 / 1200) * np.cos(np.sqrt(1200.0) * t)
    np.testing.assert_allclose(run["position"][after], expected, atol=1e-11)


def test_a_retreat_moves_the_surface_away_from_the_tool():
    still = constant(2e-3, 0.3)
    moved = retreating(still, StepSequence(times=(0.0, 0.1, 0.2), levels=(0.0, 5e-3, 0.0)))
    instants = np.array([0.05, 0.1, 0.15, 0.2, 0.25])
    np.testing.assert_allclose(moved(instants)[0], [2e-3, 7e-3, 7e-3, 2e-3, 2e-3], atol=1e-15)
    run = pressed_mass(
        OneSided(tissue=SPRING), mass=1.0, push=1.0, heart=moved, start=2e-3 + 1.0 / 800.0
    )
    # 3.75 mm away, 1 N on 1 kg crosses the gap in √(2 · 3.75 mm / 1 m/s²) = 86.6 ms.
    away = (run["time"] > 0.0995) & (run["time"] < 0.186)
    assert run["force"][187] > 0.0
    assert np.all(run["force"][away] == 0.0)
    np.testing.assert_allclose(run["force"][run["time"] < 0.0995], 1.0, atol=1e-11)


def test_rest_depth_holds_the_force():
    factor = StepSequence(times=(0.0,), levels=(2.0,))
    inner = WithDamper(tissue=SPRING, damping=3.0)
    contact = OneSided(tissue=ScheduledTissue(tissue=inner, factor=factor))
    depth = contact.rest_depth([1.0])
    assert force_of(
        contact, depth=float(depth[0]), heart_velocity=0.0, tissue_factor=2.0
    ) == pytest.approx(1.0, rel=1e-14)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: LinearSpring(0.0), "stiffness"),
        (lambda: LinearSpring((800.0, float("nan"))), "stiffness"),
        (lambda: LinearSpring((800.0, 900.0)).values(3), "3 axes"),
        (lambda: WithDamper(tissue=SPRING, damping=-1.0), "damping"),
        (
            lambda: ScheduledTissue(
                tissue=SPRING, factor=StepSequence(times=(0.0, 1.0), levels=(1.0, 0.0))
            ),
            "factor",
        ),
        (lambda: OneSided(tissue=SPRING).rest_depth([-1.0]), "cannot pull"),
    ],
)
def test_bad_choices_are_named(make, words):
    with pytest.raises(ParameterError, match=words):
        make()
