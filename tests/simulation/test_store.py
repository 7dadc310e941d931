"""The store of an ensemble: what is damaged or foreign is told, never taken for results."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from mrac_design.errors import EnsembleError
from mrac_design.simulation.store import EnsembleStore, StoredEnsemble

zarr = pytest.importorskip("zarr")

ENSEMBLE = StoredEnsemble(
    fingerprint="f" * 64, version="1.2.3", runs=10, seed=7, chunk=4, metrics=("a", "b")
)
ROWS = np.random.default_rng(0).normal(size=(10, 2))
ROWS[5, 1] = np.nan  # a diverged run


def chunk(number):
    return ROWS[4 * number : 4 * (number + 1)]


@pytest.fixture
def path(tmp_path):
    """A store in which the middle chunk is missing."""
    store = EnsembleStore(tmp_path / "deep" / "store")
    store.open(ENSEMBLE)
    for number in (0, 2):
        store.write(number, chunk(number))
    return store.path


def kept(path, ensemble=ENSEMBLE):
    store = EnsembleStore(path)
    store.open(ensemble)
    return {number: store.read(number) for number in sorted(store.finished())}


def test_what_was_kept_comes_back_bit_for_bit(path):
    found = kept(path)
    assert list(found) == [0, 2]
    assert all(found[number].tobytes() == chunk(number).tobytes() for number in found)
    assert [entry.name for entry in path.parent.iterdir()] == ["store"]


def test_a_diverged_run_is_no_damage(path):
    store = EnsembleStore(path)
    store.open(ENSEMBLE)
    store.write(1, chunk(1))
    assert np.array_equal(kept(path)[1], chunk(1), equal_nan=True)


DAMAGES = {
    "empty": lambda raw: b"",
    "cut off": lambda raw: raw[: len(raw) // 2],
    "foreign": lambda raw: b"\xff\x00 nothing of ours",
    "one bit": lambda raw: raw[:-1] + bytes([raw[-1] ^ 16]),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_named(path, damage):
    files = sorted(file for file in path.rglob("*") if file.is_file())
    assert len(files) == 7
    for file in files:
        raw = file.read_bytes()
        file.write_bytes(DAMAGES[damage](raw))
        with pytest.raises(EnsembleError) as problem:
            kept(path)
        words = str(problem.value)
        # A checksum and its chunk accuse each other; the remedy is the same.
        number = file.relative_to(path).parts[2:3]
        assert str(file) in words or str(path / "finished" / "c" / number[0]) in words
        assert "is damaged" in words
        assert "\n" not in words
        file.write_bytes(raw)
    assert list(kept(path)) == [0, 2]


def test_a_missing_file_is_named_and_its_remedy_works(path):
    (path / "metrics" / "c" / "2" / "0").unlink()
    with pytest.raises(EnsembleError, match=r"metrics/c/2/0 is damaged \(it is missing\)") as told:
        kept(path)
    flag = path / "finished" / "c" / "2"
    assert f"remove {flag}" in str(told.value)
    flag.unlink()
    assert list(kept(path)) == [0]
    (path / "metrics" / "zarr.json").unlink()
    with pytest.raises(EnsembleError, match=r"metrics/zarr.json is damaged \(it is missing\)"):
        kept(path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"runs": 12}, r"\(runs 10, not 12\)"),
        ({"seed": 8, "version": "2.0"}, r"\(mrac_design 1.2.3, not 2.0; seed 7, not 8\)"),
        ({}, r"another scenario, spread or step"),
    ],
)
def test_another_ensemble_is_refused_with_what_differs(path, change, words):
    with pytest.raises(EnsembleError, match=words):
        kept(path, replace(ENSEMBLE, fingerprint="e" * 64, **change))
    assert list(kept(path)) == [0, 2]


def test_what_is_no_store_is_left_alone(path, tmp_path):
    document = json.loads((path / "zarr.json").read_text())
    del document["attributes"]["format"]
    (path / "zarr.json").write_text(json.dumps(document))
    before = {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}
    with pytest.raises(EnsembleError, match="no ensemble of this version"):
        kept(path)
    assert {file: file.read_bytes() for file in path.rglob("*") if file.is_file()} == before
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    with pytest.raises(EnsembleError, match=r"mine holds letter.txt, but no zarr.json"):
        kept(tmp_path / "mine")


def test_an_empty_folder_and_a_second_maker_are_served(path, tmp_path, monkeypatch):
    (tmp_path / "empty").mkdir()
    assert kept(tmp_path / "empty") == {}
    # Another process makes the store after this one looked and before it is done.
    slow = EnsembleStore(tmp_path / "raced")
    make = EnsembleStore._make

    def late(store, *arguments):
        shutil.copytree(path, store.path)
        make(store, *arguments)

    monkeypatch.setattr(EnsembleStore, "_make", late)
    slow.open(ENSEMBLE)
    assert slow.finished() == {0, 2}
