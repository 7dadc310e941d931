"""Reading recorded tracks: what comes out, and one clear error for what cannot be read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from scipy.signal import butter, freqz

from mrac_design.errors import MotionFileError, ParameterError
from mrac_design.motion import Origin, read_recorded_motion, recorded

from .tracks import slow_track, write_csv

RATE = 25.0


@pytest.fixture
def track(tmp_path: Path) -> Path:
    return write_csv(tmp_path / "track.csv", slow_track(250, RATE))


def test_slow_motion_comes_back_in_metres_without_its_mean(track: Path) -> None:
    motion = read_recorded_motion(track, frame_rate=RATE, cutoff=8.0)
    t = np.arange(50, 200) / RATE
    expected = slow_track(250, RATE)[50:200].T * 1e-3
    offset = motion.displacement(t) - expected
    # Away from the ends the filter passes 2.4 Hz up to (2.4/8)^8 ~ 7e-5 of 1 mm.
    np.testing.assert_allclose(offset - offset.mean(axis=1, keepdims=True), 0.0, atol=2e-7)
    np.testing.assert_allclose(motion.displacement.mean(), 0.0, atol=1e-15)  # rounding
    assert motion.duration == pytest.approx(249 / RATE)
    assert motion.origin is Origin.RECORDED
    assert any("25 Hz" in sentence for sentence in motion.assumptions)
    assert "recorded" in motion._repr_markdown_()


def test_the_low_pass_has_the_stated_response_and_no_phase(tmp_path: Path) -> None:
    t = np.arange(500) / RATE
    position = np.stack([np.sin(2 * np.pi * f * t) for f in (2.0, 6.0, 9.0)], axis=1)
    path = write_csv(tmp_path / "sines.csv", position)
    motion = read_recorded_motion(path, frame_rate=RATE, cutoff=6.0)
    used = slice(100, 400)
    found = motion.displacement(t)[:, used] * 1e3
    _, response = freqz(*butter(4, 6.0, fs=RATE), worN=[2.0, 6.0, 9.0], fs=RATE)
    for axis in range(3):
        # Forwards and backwards: the squared magnitude, in phase with the input.
        expected = np.abs(response[axis]) ** 2 * position[used, axis]
        np.testing.assert_allclose(found[axis], expected, atol=2e-3)  # what is left of the ends


def test_a_kept_recording_has_the_bits_of_the_first_reading(track: Path, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))

    def coefficients(**changed: float) -> bytes:
        choices = {"frame_rate": RATE, "cutoff": 8.0, "start_frame": 0, **changed}
        return read_recorded_motion(track, **choices).displacement.coefficients.tobytes()

    first = coefficients()
    others = [{"cutoff": 7.0}, {"frame_rate": 26.0}, {"start_frame": 1}]
    assert len({first, *(coefficients(**changed) for changed in others)}) == 4
    with monkeypatch.context() as without:
        without.setattr(recorded, "low_pass", None)  # what is kept needs no filter
        assert coefficients() == first
    write_csv(track, 2.0 * slow_track(250, RATE))
    assert coefficients() != first


def test_frame_rate_stretches_time_and_a_start_frame_moves_it(track: Path) -> None:
    slow = read_recorded_motion(track, frame_rate=20.0, cutoff=6.4)
    fast = read_recorded_motion(track, frame_rate=40.0, cutoff=12.8)
    # The same frames in half the time: rounding in the spline only.
    np.testing.assert_allclose(fast.peak_velocity, 2.0 * slow.peak_velocity, rtol=1e-9)
    late = read_recorded_motion(track, frame_rate=20.0, cutoff=6.4, start_frame=100, duration=3.0)
    difference = slow.displacement([6.5])[:, 0] - late.displacement([1.5])[:, 0]
    again = slow.displacement([7.0])[:, 0] - late.displacement([2.0])[:, 0]
    # Only the mean differs; the splines' end conditions reach some frames (factor 0.27 each).
    np.testing.assert_allclose(difference, again, atol=1e-9)
    assert late.duration == 3.0


def test_csv_and_matlab_agree_in_every_unit(tmp_path: Path) -> None:
    position = slow_track(100, RATE)
    reference = read_recorded_motion(
        write_csv(tmp_path / "a.csv", position), frame_rate=RATE
    ).displacement.coefficients
    for unit, scale in (("m", 1e-3), ("cm", 0.1), ("um", 1e3)):
        path = write_csv(tmp_path / f"{unit}.csv", position * scale, unit=unit)
        again = read_recorded_motion(path, frame_rate=RATE).displacement.coefficients
        np.testing.assert_allclose(again, reference, rtol=1e-9, atol=1e-12)  # one rounding
    bare = write_csv(tmp_path / "bare.csv", position, unit="")
    again = read_recorded_motion(bare, frame_rate=RATE, unit="mm").displacement.coefficients
    np.testing.assert_array_equal(again, reference)
    matlab = tmp_path / "a.mat"
    vectors = {f"p4_{axis}_mm": position[:, index] for index, axis in enumerate("xyz")}
    savemat(matlab, vectors | {"frame": np.arange(100.0), "comment": "left alone"})
    again = read_recorded_motion(matlab, frame_rate=RATE).displacement.coefficients
    np.testing.assert_array_equal(again, reference)


def _edited(edit: Callable[[list[str]], list[str]]) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        path.write_text("\n".join(edit(path.read_text().splitlines())) + "\n")

    return change


def _cell(row: int, text: str) -> Callable[[Path], None]:
    def edit(lines: list[str]) -> list[str]:
        cells = lines[row - 1].split(",")
        cells[2] = text
        return [*lines[: row - 1], ",".join(cells), *lines[row:]]

    return _edited(edit)


BAD_FILES = {
    "missing": (lambda path: path.unlink(), "no such file"),
    "empty": (lambda path: path.write_bytes(b""), "empty"),
    "blank": (lambda path: path.write_text("\n\n"), "empty"),
    "header only": (_edited(lambda lines: lines[:1]), "no frames"),
    "nan": (_cell(7, "nan"), "row 7, column p4_y_mm: nan is not a finite"),
    "infinite": (_cell(9, "-inf"), "row 9, column p4_y_mm"),
    "text": (_cell(5, "1.2.3"), r"row 5, column p4_y_mm: '1\.2\.3' is not a number"),
    "underscore": (_cell(5, "1_2"), "row 5, column p4_y_mm"),
    "gap": (_cell(6, ""), "row 6, column p4_y_mm: an empty cell"),
    "ragged": (_edited(lambda lines: [*lines[:3], "2,1.0", *lines[4:]]), "row 4.*2 cells"),
    "wrong column": (
        _edited(lambda lines: [lines[0].replace("p4_y", "p4_w"), *lines[1:]]),
        r"no column p4_y_<unit>; the file has points p4 \(columns: frame, p4_x_mm",
    ),
    "twice": (
        _edited(lambda lines: [lines[0].replace("p4_y", "p4_x"), *lines[1:]]),
        "more than once",
    ),
    "unit": (_edited(lambda lines: [lines[0].replace("mm", "ell"), *lines[1:]]), "'ell'"),
    "no unit": (_edited(lambda lines: [lines[0].replace("_mm", ""), *lines[1:]]), "no unit"),
    "frame gap": (_edited(lambda lines: lines[:11] + lines[12:]), "row 12.*frame 11 after frame 9"),
    "too short": (_edited(lambda lines: lines[:16]), "15 frames: too short"),
    "binary": (lambda path: path.write_bytes(b"\xff\xfe\x00\x80" * 9), "not a CSV text"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_a_bad_file_is_one_clear_error(case: str, track: Path) -> None:
    spoil, message = BAD_FILES[case]
    spoil(track)
    with pytest.raises(MotionFileError, match=message) as caught:
        read_recorded_motion(track, frame_rate=RATE)
    assert str(track) in str(caught.value)


@pytest.mark.parametrize("rate", [0.0, -25.0, float("nan"), float("inf")])
def test_a_bad_frame_rate_is_refused(rate: float, track: Path) -> None:
    with pytest.raises(MotionFileError, match="frame rate"):
        read_recorded_motion(track, frame_rate=rate)


def test_requests_the_track_cannot_meet_are_refused(track: Path, tmp_path: Path) -> None:
    with pytest.raises(MotionFileError, match=r"last 9\.96 s at 25 Hz, but 12 s"):
        read_recorded_motion(track, frame_rate=RATE, duration=12.0)
    with pytest.raises(MotionFileError, match=r"point p9.*points p4"):
        read_recorded_motion(track, frame_rate=RATE, point="p9")
    with pytest.raises(MotionFileError, match="start frame"):
        read_recorded_motion(track, frame_rate=RATE, start_frame=249)
    with pytest.raises(MotionFileError, match="not in cm"):
        read_recorded_motion(track, frame_rate=RATE, unit="cm")
    for cutoff in (12.5, 20.0, 0.0, float("nan")):
        with pytest.raises(ParameterError, match=r"between 0 and 12\.5 Hz"):
            read_recorded_motion(track, frame_rate=RATE, cutoff=cutoff)
    for duration in (0.0, -1.0, float("nan")):
        with pytest.raises(ParameterError, match="duration"):
            read_recorded_motion(track, frame_rate=RATE, duration=duration)
    with pytest.raises(MotionFileError, match=r"'\.txt' is not supported"):
        read_recorded_motion(track.rename(tmp_path / "a.txt"), frame_rate=RATE)
    with pytest.raises(MotionFileError, match="is not a file"):
        read_recorded_motion(tmp_path, frame_rate=RATE)
    with pytest.raises(MotionFileError, match="heart_invivo_fit"):
        read_recorded_motion("heart_invivo_fits", frame_rate=RATE)


def test_bad_matlab_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    path.write_text("not a MATLAB file at all, just some text that is long enough" * 9)
    with pytest.raises(MotionFileError, match="MATLAB"):
        read_recorded_motion(path, frame_rate=RATE)
    position = slow_track(50, RATE)
    savemat(
        path, {"p4_x_mm": position[:, 0], "p4_y_mm": position[:40, 1], "p4_z_mm": position[:, 2]}
    )
    with pytest.raises(MotionFileError, match="differ in length"):
        read_recorded_motion(path, frame_rate=RATE)
    savemat(path, {"positions": position})
    with pytest.raises(MotionFileError, match="no tracked point"):
        read_recorded_motion(path, frame_rate=RATE)
    position[3, 1] = np.nan
    savemat(path, {f"p4_{axis}_mm": position[:, index] for index, axis in enumerate("xyz")})
    with pytest.raises(MotionFileError, match="row 4, column p4_y_mm"):
        read_recorded_motion(path, frame_rate=RATE)
