"""Compiling and caching under everything that can be wrong with a compiler and a disk."""

from __future__ import annotations

import logging
import multiprocessing
import os
import stat
from pathlib import Path

import pytest

from mrac_design.errors import CompilationError
from mrac_design.simulation import compilation, engine
from mrac_design.simulation.compilation import compile_library, find_compiler
from mrac_design.simulation.engine import build_engine
from mrac_design.simulation.tableau import RK4
from tests.simulation.small_systems import pendulum

SOURCE = "int answer(void) { return 42; }\n"

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler here")


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "mrac_design"


def fake_compiler(folder: Path, script: str) -> str:
    path = folder / "cc"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


@needs_compiler
def test_second_build_comes_from_the_cache(cache, tmp_path, monkeypatch):
    assert compile_library(SOURCE, find_compiler()).answer() == 42
    (library,) = cache.glob("*.so")
    assert [entry.name for entry in cache.iterdir()] == [library.name]
    monkeypatch.setattr(compilation, "_compile", lambda *_: pytest.fail("compiled again"))
    assert compile_library(SOURCE, find_compiler()).answer() == 42


@needs_compiler
def test_other_source_is_another_library(cache):
    assert compile_library(SOURCE, find_compiler()).answer() == 42
    assert compile_library(SOURCE.replace("42", "43"), find_compiler()).answer() == 43


@needs_compiler
def test_damaged_library_is_compiled_anew(cache, tmp_path, monkeypatch):
    compile_library(SOURCE, find_compiler())
    (library,) = cache.glob("*.so")
    other = tmp_path / "other" / "mrac_design"
    other.mkdir(parents=True)
    (other / library.name).write_bytes(library.read_bytes()[:100])
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
    assert compile_library(SOURCE, find_compiler()).answer() == 42


@needs_compiler
def test_cache_that_cannot_be_written_is_replaced_by_a_private_folder(tmp_path, monkeypatch):
    # A file where the folder should be stops even the superuser.
    (tmp_path / "mrac_design").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert compile_library(SOURCE, find_compiler()).answer() == 42


@needs_compiler
def test_full_disk_is_noticed_and_another_folder_used(cache, tmp_path, monkeypatch):
    script = f'case "$PWD$*" in *{cache}*) echo "fatal: No space left on device" >&2; exit 1;; esac'
    compiler = fake_compiler(tmp_path, f'{script}\nexec {find_compiler()} "$@"')
    assert compile_library(SOURCE, compiler).answer() == 42
    assert not list(cache.iterdir())


@needs_compiler
def test_nowhere_to_write_is_one_clear_sentence(tmp_path, monkeypatch):
    (tmp_path / "mrac_design").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))

    def full():
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(compilation, "_private_directory", full)
    with pytest.raises(CompilationError, match=r"nowhere to keep.*No space left") as caught:
        compile_library(SOURCE, find_compiler())
    assert "\n" not in str(caught.value)


def _build(folder: str) -> int:
    os.environ["XDG_CACHE_HOME"] = folder
    return int(compile_library(SOURCE, find_compiler()).answer())


@needs_compiler
def test_processes_may_build_at_once(tmp_path):
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        assert pool.map(_build, [str(tmp_path)] * 4, chunksize=1) == [42] * 4
    assert len(list((tmp_path / "mrac_design").iterdir())) == 1


@pytest.mark.parametrize(
    ("script", "message"),
    [("echo 'program.c:1: error: bad day' >&2; exit 1", "bad day"), ("exit 0", "no library")],
)
def test_failing_compiler_is_one_warning_and_another_machine(
    cache, tmp_path, monkeypatch, caplog, script, message
):
    monkeypatch.setenv("CC", fake_compiler(tmp_path, script))
    with caplog.at_level(logging.WARNING):
        built = build_engine(pendulum(), RK4, input_powers=3)
    assert built.name in ("LLVM", "CasADi interpreter")
    (record,) = caplog.records
    assert message in record.getMessage()
    assert "\n" not in record.getMessage()


def test_without_compiler_and_llvm_the_interpreter_runs(monkeypatch, caplog):
    monkeypatch.setenv("CC", "")
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(engine, "llvm_available", lambda: False)
    with caplog.at_level(logging.WARNING):
        built = build_engine(pendulum(), RK4, input_powers=3)
    assert built.name == "CasADi interpreter"
    assert "no C compiler found" in caplog.text
