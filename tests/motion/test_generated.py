"""Generated motions: the closed form, smoothness, rhythms, and the packaged models."""

from __future__ import annotations

import numpy as np
import pytest

from mrac_design.errors import ParameterError
from mrac_design.motion import (
    Breathing,
    JitteredRhythm,
    Origin,
    PiecewisePolynomial,
    RegularRhythm,
    VariableRhythm,
    WithEctopicBeat,
    available_motions,
    find_model,
    fitted_motion,
    load_motion,
    parametric_motion,
)
from mrac_design.motion.jets import Jet, harmonics, smooth_phase, smooth_steps
from mrac_design.motion.rhythm import cardiac_phase, correlated_scores
from tests.oracles import fourier_sum


@pytest.mark.parametrize("cardiac", [1.25, 2.0])
def test_regular_motion_is_the_sum_of_cosines(cardiac: float) -> None:
    motion = parametric_motion(7.3, rhythm=RegularRhythm(mean_period=1.0 / cardiac))
    t = np.random.default_rng(1).uniform(0.0, 7.3, 3000)
    for index, axis in enumerate("XYZ"):
        expected = np.array([fourier_sum.displacement(axis, x, cardiac, 0.25) for x in t])
        difference = motion.displacement(t)[index] - expected
        # Constant (the mean taken off) up to the quintic's h⁶ max|f⁽⁶⁾|/46080 ~ 2e-11 m.
        assert np.ptp(difference) < 1e-10
    assert motion.origin is Origin.ASSUMED


@pytest.mark.parametrize("name", available_motions())
def test_packaged_motions_follow_their_closed_form_smoothly(name: str) -> None:
    model = find_model(name)
    assert model.name == name
    motion = model.motion(20.0)
    t = np.sort(np.random.default_rng(2).uniform(0.0, 20.0, 20_000))
    closed = model.displacement(t).value
    offset = motion.displacement(t) - closed
    assert np.ptp(offset, axis=1).max() < 1e-9  # m, a millionth of the motion
    start = model.displacement(np.array([0.0, 20.0])).value[:, 0] + offset.mean(axis=1)
    np.testing.assert_allclose(motion.initial_displacement, start, atol=1e-9)
    signal = motion.displacement
    lengths = np.diff(signal.breakpoints)
    assert lengths.min() > 0.002
    for order, tolerance in ((signal, 1e-12), (signal.derivative(), 1e-10)):
        ends = np.stack([_end_values(order, channel) for channel in range(3)])
        starts = order.coefficients[:, 1:, 0]
        # Continuous to rounding: coefficients of order 1e5 times h⁵.
        np.testing.assert_allclose(ends[:, :-1], starts, atol=tolerance)
    np.testing.assert_allclose(signal.mean(), 0.0, atol=1e-15)


def _end_values(signal: PiecewisePolynomial, channel: int) -> np.ndarray:
    lengths = np.diff(signal.breakpoints)
    powers = lengths[:, None] ** np.arange(signal.degree + 1)
    return (signal.coefficients[channel] * powers).sum(axis=1)


@pytest.mark.parametrize("name", available_motions())
def test_rates_are_the_derivatives_of_the_closed_form(name: str) -> None:
    model = find_model(name)
    h = 1e-5
    middles = np.sort(
        np.linspace(0.003, 11.99, 2000) + np.random.default_rng(4).uniform(-2e-3, 2e-3, 2000)
    )
    jet = model.displacement(np.sort(np.concatenate((middles - h, middles, middles + h))))
    before, after = slice(0, None, 3), slice(2, None, 3)
    # Central differences at 10 µs: truncation h²/6·f‴ ~ 1e-9, rounding 1e-17/1e-5.
    velocity = (jet.value[:, after] - jet.value[:, before]) / (2.0 * h)
    np.testing.assert_allclose(jet.rate[:, 1::3], velocity, atol=1e-8)
    acceleration = (jet.rate[:, after] - jet.rate[:, before]) / (2.0 * h)
    np.testing.assert_allclose(jet.second_rate[:, 1::3], acceleration, atol=1e-6)


def test_the_same_seed_gives_the_same_motion_and_a_longer_one_goes_on() -> None:
    first, again = fitted_motion("heart_invivo_fit", 8.0), fitted_motion("heart_invivo_fit", 8.0)
    np.testing.assert_array_equal(first.displacement.coefficients, again.displacement.coefficients)
    longer = load_motion("heart_invivo_fit", duration=25.0)
    t = np.linspace(0.0, 8.0, 500)
    # The mean over another duration differs, nothing else.
    assert np.ptp(longer.displacement(t) - first.displacement(t), axis=1).max() < 1e-12
    other = load_motion("heart_invivo_fit", duration=8.0, seed=77)
    assert np.abs(other.displacement(t) - first.displacement(t)).max() > 1e-4


def test_the_fitted_motion_has_the_size_of_the_recording_and_says_so() -> None:
    motion = fitted_motion("heart_invivo_fit", 30.0)
    # Published figures of the track, raw: 4.64 × 1.84 × 3.09 mm; random beats stray by a third.
    np.testing.assert_allclose(motion.peak_to_peak, [4.64e-3, 1.84e-3, 3.09e-3], rtol=0.35)
    assert motion.origin is Origin.FITTED
    text = motion._repr_markdown_()
    for word in ("fitted", "ST-LSTM", "frame rate is taken as 25 Hz"):
        assert word in text


def test_parametric_sizes_match_their_table() -> None:
    # Peak to peak of the sums over 12 s, as tabulated to 0.1 mm.
    np.testing.assert_allclose(
        parametric_motion(12.0).peak_to_peak, [5.5e-3, 5.3e-3, 12.7e-3], atol=5e-5
    )


def test_breathing_stops_and_is_held() -> None:
    motion = load_motion("parametric_apnoea", duration=12.0)
    breathing = load_motion("parametric", duration=12.0)
    beat = 0.8
    late = np.linspace(5.6, 9.0, 200)
    held = motion.displacement(late + beat) - motion.displacement(late)
    np.testing.assert_allclose(held, 0.0, atol=1e-9)  # strictly periodic with the beat
    moving = breathing.displacement(late + beat) - breathing.displacement(late)
    assert np.abs(moving).max() > 1e-3
    early = np.linspace(0.0, 4.4, 200)
    assert np.ptp(motion.displacement(early) - breathing.displacement(early), axis=1).max() < 1e-9


def test_an_ectopic_beat_moves_one_onset_only() -> None:
    model = find_model("parametric_ectopic")
    onsets = model.onsets(12.0)
    regular = 0.8 * np.arange(onsets.size)
    moved = np.flatnonzero(np.abs(onsets - regular) > 1e-9)
    np.testing.assert_array_equal(moved, [5])
    assert onsets[5] == pytest.approx(regular[5] - 0.35 * 0.8)


def test_jitter_stays_within_its_bound_and_is_used() -> None:
    lengths = np.diff(find_model("parametric_jitter").onsets(200.0))
    assert np.abs(lengths / 0.8 - 1.0).max() <= 0.05 + 1e-12
    assert lengths.std() == pytest.approx(0.8 * 0.05 / np.sqrt(3.0), rel=0.2)  # 250 draws


def test_random_scores_have_the_stated_correlation() -> None:
    correlations = np.array([-0.6, 0.0, 0.8])
    scores = correlated_scores(20_000, correlations, np.random.default_rng(5))
    measured = [np.corrcoef(row[1:], row[:-1])[0, 1] for row in scores]
    # Clipping at ±2 takes a few percent; the sampling error is 0.007.
    np.testing.assert_allclose(measured, correlations, atol=0.05)
    np.testing.assert_allclose(scores.std(axis=1), 1.0, atol=0.06)
    assert np.abs(scores).max() <= 2.0


def test_phase_passes_one_cycle_a_beat_and_systole_keeps_its_length() -> None:
    intervals = np.array([1.0, 0.8, 1.3, 1.0, 0.7, 1.0])
    onsets = np.concatenate(([0.0], np.cumsum(intervals)))
    # Probe where no change of pace (15 % of the mean period wide) is under way.
    middles = onsets[:-1] + 0.25
    phase = cardiac_phase(middles, intervals, mean_period=1.0, systole=0.5)
    np.testing.assert_allclose(phase.value, np.arange(6) + 0.25, atol=1e-12)
    t = np.linspace(0.0, onsets[-1] - 0.1, 5000)
    assert cardiac_phase(t, intervals, mean_period=1.0, systole=0.5).rate.min() > 0.0
    whole = cardiac_phase(onsets[:-1] + 0.5 * intervals, intervals, mean_period=1.0, systole=0.0)
    np.testing.assert_allclose(whole.value, np.arange(6) + 0.5, atol=1e-12)


def test_steps_are_monotone_and_end_at_their_levels() -> None:
    t = np.linspace(0.0, 3.0, 3001)
    levels = np.array([[1.0, 3.0, 2.0]])
    steps = smooth_steps(t, np.array([1.0, 2.0]), levels, 0.4)
    np.testing.assert_allclose(steps.value[0, [0, 1000, 1500, 3000]], [1, 2, 3, 2], atol=1e-12)
    phase = smooth_phase(t, np.array([1.0, 2.0]), levels[0], 0.4)
    np.testing.assert_array_equal(phase.rate, steps.value[0])
    # Trapezoids on 1 ms: h²/12 max|f″| ~ 1e-6.
    integral = np.concatenate(([0.0], np.cumsum(0.5e-3 * (phase.rate[1:] + phase.rate[:-1]))))
    np.testing.assert_allclose(phase.value, integral, atol=5e-6)


def test_products_of_jets_follow_leibniz() -> None:
    t = np.linspace(0.0, 1.0, 11)
    ramp = Jet(value=t, rate=np.ones(11), second_rate=np.zeros(11))
    square = ramp * ramp
    np.testing.assert_allclose(square.second_rate, 2.0)
    waves = harmonics(ramp, 2)
    product = Jet(value=waves.value[3], rate=waves.rate[3], second_rate=waves.second_rate[3]) * ramp
    w = 4.0 * np.pi
    expected = -t * w**2 * np.cos(w * t) - 2.0 * w * np.sin(w * t)
    np.testing.assert_allclose(product.second_rate, expected, atol=1e-10)  # rounding of w²


def test_numbers_without_meaning_are_refused() -> None:
    for make in (
        lambda: RegularRhythm(mean_period=0.0),
        lambda: JitteredRhythm(mean_period=0.8, jitter=0.9),
        lambda: VariableRhythm(mean_period=1.0, deviation=0.5, correlation=0.0),
        lambda: VariableRhythm(mean_period=1.0, deviation=0.1, correlation=1.0),
        lambda: WithEctopicBeat(rhythm=RegularRhythm(mean_period=1.0), beat=-1, prematurity=0.2),
        lambda: WithEctopicBeat(rhythm=RegularRhythm(mean_period=1.0), beat=1, prematurity=0.9),
        lambda: Breathing(frequency=-0.2),
        lambda: Breathing(frequency=0.2, stop=0.1, fade=1.0),
        lambda: parametric_motion(0.0),
        lambda: parametric_motion(float("nan")),
        lambda: parametric_motion(1.0, seed=-1),
    ):
        with pytest.raises(ParameterError):
            make()
