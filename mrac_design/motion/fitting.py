"""Fit of the dual Fourier model to a recorded track, with its quality on held-back frames.

Run as `python -m mrac_design.motion.fitting RECORDING.csv --out FILE`.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from scipy.signal import butter, filtfilt

from mrac_design.arrays import FloatArray
from mrac_design.errors import MotionFileError, MracDesignError, ParameterError
from mrac_design.motion.beats import find_beats
from mrac_design.motion.dual_fourier import BeatVariation, Breathing, DualFourierModel
from mrac_design.motion.fit_file import Fit, write_fit
from mrac_design.motion.fit_quality import (
    Residual,
    generated_statistics,
    recorded_statistics,
    residual_of,
)
from mrac_design.motion.fit_series import (
    FASTEST_BREATH,
    Recording,
    beat_phase,
    breathing_frequency,
    fit_series,
    fit_variation,
    lag_one_correlation,
    series_values,
    steady_phase,
)
from mrac_design.motion.heart import Origin
from mrac_design.motion.jets import Jet
from mrac_design.motion.recorded import FILTER_ORDER, low_pass
from mrac_design.motion.rhythm import VariableRhythm
from mrac_design.motion.track_file import read_track

logger = logging.getLogger(__name__)

SHORTEST_TRAINING = 10.0
"""Least length of the training frames, s: one breath and several beats."""
FEWEST_BEATS = 6
"""Least number of beats to draw statistics from."""
SEED = 8
"""Seed given to a model: of 1 … 12 the one whose first 12 s come closest to the in-vivo
recording in root mean square and peak acceleration, erring towards the harsher."""
SEEDS = range(1, 21)
"""Seeds whose motions are compared with the recording."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Clock:
    """Beats and breaths of a recording."""

    onsets: FloatArray
    """Beats found in all frames, s."""
    training_onsets: FloatArray
    """Those that start in the training frames, s."""
    period: float
    """Mean interval of the training beats, s."""
    systole: float
    """Start of a beat that keeps its length, s."""
    breath: float
    """Respiratory frequency, Hz."""

    def phase(self, t: FloatArray, onsets: FloatArray) -> Jet:
        """Cardiac phase at `t` (N,), s, if the beats start at `onsets`, s."""
        return beat_phase(t, onsets, period=self.period, systole=self.systole)


def fit_recording(
    recording: Recording, *, name: str, source: str, assumptions: tuple[str, ...], seed: int
) -> Fit:
    """Fit beats, breathing, their product and the beat-to-beat variation to `recording`.

    Beat times are measured in all frames, with a template from the training frames: the first
    residual tells how well the fitted shapes carry over to later beats, the others what is
    left when the later beats' times are not measured. Raises ParameterError for a recording
    that is too short or has too few beats.
    """
    t = recording.time
    clock = _measure_clock(recording)
    respiratory = steady_phase(t, clock.breath)
    phase = clock.phase(t, clock.onsets)
    coefficients = fit_series(recording, phase, respiratory)
    fitted = series_values(coefficients, phase, respiratory)
    coasting = clock.phase(t, clock.training_onsets)
    rhythm = _rhythm(clock)
    variation = _variation(recording, clock, fitted)
    model = DualFourierModel(
        name=name,
        origin=Origin.FITTED,
        source=source,
        assumptions=assumptions,
        coefficients=coefficients,
        rhythm=rhythm,
        systole=clock.systole,
        breathing=Breathing(frequency=clock.breath),
        variation=variation,
        seed=seed,
    )
    guessed = "measured in training frames, the mean interval afterwards"
    return Fit(
        model=model,
        rhythm=rhythm,
        variation=variation,
        onsets=clock.onsets,
        residuals=(
            residual_of(recording, fitted, "measured in all frames"),
            residual_of(recording, series_values(coefficients, coasting, respiratory), guessed),
            _one_period_residual(recording, respiratory, clock.period),
        ),
        recorded=recorded_statistics(recording),
        generated=generated_statistics(model, float(t[-1]), SEEDS),
    )


def _variation(recording: Recording, clock: _Clock, fitted: FloatArray) -> BeatVariation:
    """What the shapes leave of the training frames, beat by beat."""
    training = slice(0, recording.training)
    t = recording.time[training]
    return fit_variation(
        (recording.position - fitted)[training],
        t,
        clock.training_onsets,
        clock.phase(t, clock.onsets),
        clock.period,
    )


def _measure_clock(recording: Recording) -> _Clock:
    """Breathing, beats and systole of `recording`."""
    end = recording.training_time
    if end < SHORTEST_TRAINING:
        raise ParameterError(
            "training", f"{end:g} s", f"needs at least {SHORTEST_TRAINING:g} s of motion"
        )
    breath = breathing_frequency(recording)
    b, a = butter(3, FASTEST_BREATH / (0.5 * recording.frame_rate), "high")
    beating = filtfilt(b, a, recording.position, axis=0)
    found = find_beats(beating, frame_rate=recording.frame_rate, training=recording.training)
    known = found.onsets[found.onsets < end]
    if known.size < FEWEST_BEATS:
        raise ParameterError(
            "beats found", known.size, f"needs {FEWEST_BEATS} alike beats to fit; is it a heart?"
        )
    period = float(np.diff(known).mean())
    logger.info(
        "%d beats, mean interval %.4f s, breath %.4f s", found.onsets.size, period, 1.0 / breath
    )
    return _Clock(
        onsets=found.onsets,
        training_onsets=known,
        period=period,
        systole=_best_systole(
            recording, found.onsets, period, steady_phase(recording.time, breath)
        ),
        breath=breath,
    )


def _rhythm(clock: _Clock) -> VariableRhythm:
    """Statistics of the training beats' lengths."""
    intervals = np.diff(clock.training_onsets)
    return VariableRhythm(
        mean_period=clock.period,
        deviation=float(intervals.std(ddof=1)),
        correlation=lag_one_correlation(intervals),
    )


def _best_systole(
    recording: Recording, onsets: FloatArray, period: float, respiratory: Jet
) -> float:
    """Length of the inelastic start of the beat that fits the training frames best, s."""

    def cost(systole: float) -> float:
        phase = beat_phase(recording.time, onsets, period=period, systole=systole)
        fitted = series_values(fit_series(recording, phase, respiratory), phase, respiratory)
        error = (recording.position - fitted)[: recording.training]
        return float(np.mean(error**2))

    choices = period * np.arange(0.0, 0.80, 0.05)
    return float(choices[int(np.argmin([cost(item) for item in choices]))])


def _one_period_residual(recording: Recording, respiratory: Jet, period: float) -> Residual:
    """Residual of the same series when all beats are equally long, the length fitted."""
    best, best_cost, best_values = period, np.inf, recording.position
    for candidate in period * np.linspace(0.93, 1.07, 141):
        phase = steady_phase(recording.time, 1.0 / candidate)
        values = series_values(fit_series(recording, phase, respiratory), phase, respiratory)
        cost = float(np.mean((recording.position - values)[: recording.training] ** 2))
        if cost < best_cost:
            best, best_cost, best_values = candidate, cost, values
    return residual_of(recording, best_values, f"one interval of {best:.4f} s throughout")


def fit_file(
    path: Path,
    *,
    name: str,
    source: str,
    point: str,
    frame_rate: float,
    cutoff: float,
    training: int,
    seed: int,
) -> Fit:
    """Fit one point of a track file; rates in Hz, `training` frames are fitted.

    Raises MotionFileError and ParameterError as `read_recorded_motion`.
    """
    track = read_track(path, point=point)
    position = low_pass(track.position, frame_rate=frame_rate, cutoff=cutoff, path=path)
    if not 0 < training < position.shape[0]:
        raise MotionFileError(
            path, "", f"{position.shape[0]} frames: too few to fit {training} and judge by the rest"
        )
    recording = Recording(position=position, frame_rate=frame_rate, training=training)
    return fit_recording(
        recording,
        name=name,
        source=(
            f"Fitted to {source}; point {point}, frames 1–{training} fitted, "
            f"{training + 1}–{position.shape[0]} held back."
        ),
        assumptions=(
            f"The frame rate is taken as {frame_rate:g} Hz.",
            "Camera axes x, y, z are taken as the robot's X, Y, Z.",
            f"Zero-phase Butterworth low-pass of order {FILTER_ORDER}, run forwards and "
            f"backwards, cut-off {cutoff:g} Hz.",
            "Beat lengths and shapes are drawn at random with the recording's statistics; "
            "breathing is strictly periodic.",
        ),
        seed=seed,
    )


def main(
    recording: Annotated[Path, typer.Argument(help="Track file, .csv or .mat.")],
    out: Annotated[Path, typer.Option(help="Model file to write, TOML.")],
    source: Annotated[str, typer.Option(help="Where the recording comes from.")] = "a recording",
    name: Annotated[str, typer.Option(help="Name of the model.")] = "heart_invivo_fit",
    point: Annotated[str, typer.Option(help="Tracked point.")] = "p4",
    frame_rate: Annotated[float, typer.Option(help="Frames a second (assumed).")] = 25.0,
    cutoff: Annotated[float, typer.Option(help="Cut-off of the low-pass, Hz.")] = 8.0,
    training: Annotated[int, typer.Option(help="Leading frames to fit.")] = 600,
    seed: Annotated[int, typer.Option(help="Seed written into the model.")] = SEED,
) -> None:
    """Fit the dual Fourier heart-motion model to a recorded track and write it as TOML."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    try:
        fit = fit_file(
            recording,
            name=name,
            source=source,
            point=point,
            frame_rate=frame_rate,
            cutoff=cutoff,
            training=training,
            seed=seed,
        )
        write_fit(fit, out)
    except MracDesignError as error:
        logger.error("%s", error)
        raise typer.Exit(code=2) from error
    for residual in fit.residuals:
        logger.info(
            "beats %s: held-back residual %s mm, explained %s",
            residual.beat_times,
            np.round(residual.held_back_rms * 1e3, 3),
            np.round(residual.held_back_explained, 3),
        )
    logger.info("wrote %s", out)


if __name__ == "__main__":
    typer.run(main)
