"""Derived texts are found again, and never where anything they follow from has changed."""

from __future__ import annotations

import subprocess
import sys
import time
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
import scipy

from mrac_design import derivation_cache
from mrac_design.derivation_cache import derived_text
from mrac_design.robot import build_dynamics, load_robot
from mrac_design.simulation.kept_program import kept_c_program
from mrac_design.simulation.program import c_program
from mrac_design.simulation.tableau import DORMAND_PRINCE_5, RK4
from tests.simulation.small_systems import pendulum

FOLDERS = ("rules",)
LIBRARY = "algebra 1"


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of two files in place of this one, loaded long after they were written."""
    folder = tmp_path / "package"
    (folder / "rules").mkdir(parents=True)
    (folder / "layout.py").write_text("ORDER = 'C'\n")
    (folder / "rules" / "signs.py").write_text("SIGN = 1\n")
    monkeypatch.setattr(derivation_cache, "_PACKAGE", folder)
    monkeypatch.setattr(derivation_cache, "LOADED_AT", time.time_ns() + 10**12)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    # Its files change within the process, which only remembers digests of files that do not.
    monkeypatch.setattr(derivation_cache, "_digest", derivation_cache._digest.__wrapped__)
    return folder


def never() -> str:
    pytest.fail("derived again")


def ask(text: str, content: bytes = b"pendulum", library: str = LIBRARY) -> str:
    return derived_text(FOLDERS, library, content, lambda: text)


def test_a_text_is_derived_once(package):
    assert ask("first") == "first"
    assert derived_text(FOLDERS, LIBRARY, b"pendulum", never) == "first"


CHANGES = {
    "a source": lambda package: (package / "rules" / "signs.py").write_text("SIGN = -1\n"),
    "a source of the package": lambda package: (package / "layout.py").write_text("ORDER = 'F'\n"),
    "a new source": lambda package: (package / "rules" / "more.py").write_text(""),
    "a source's name": lambda package: (package / "rules" / "signs.py").rename(
        package / "rules" / "sines.py"
    ),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_stale_text_is_never_found(package, change):
    assert ask("stale") == "stale"
    CHANGES[change](package)
    assert ask("fresh") == "fresh"
    assert derived_text(FOLDERS, LIBRARY, b"pendulum", never) == "fresh"


def test_other_content_and_other_tools_have_texts_of_their_own(package, monkeypatch):
    assert ask("stale") == "stale"
    assert ask("of another", b"pendulum, longer") == "of another"
    assert ask("by another", library="algebra 2") == "by another"
    monkeypatch.setattr(np, "__version__", "0")
    assert ask("with another NumPy") == "with another NumPy"


def test_sources_changed_since_they_were_loaded_say_nothing_about_the_code(package, monkeypatch):
    assert ask("kept") == "kept"
    monkeypatch.setattr(derivation_cache, "LOADED_AT", time.time_ns() - 10**12)
    assert ask("by the code in memory") == "by the code in memory"
    monkeypatch.setattr(derivation_cache, "LOADED_AT", time.time_ns() + 10**12)
    assert ask("anything") == "kept"


def test_code_in_memory_whose_file_is_gone_keeps_nothing(package, monkeypatch):
    assert ask("kept") == "kept"
    gone = SimpleNamespace(__file__=str(package / "rules" / "gone.py"))
    monkeypatch.setitem(sys.modules, "gone", gone)
    assert ask("by the code in memory") == "by the code in memory"


def test_a_source_changed_while_deriving_is_noticed(package, monkeypatch):
    def derive() -> str:
        (package / "rules" / "more.py").write_text("")
        return "of a mixture"

    assert derived_text(FOLDERS, LIBRARY, b"pendulum", derive) == "of a mixture"
    (package / "rules" / "more.py").unlink()
    assert ask("fresh") == "fresh"


def test_a_damaged_text_is_derived_anew(package):
    assert ask("whole") == "whole"
    (file,) = derivation_cache.cache_directory().iterdir()
    file.write_bytes(file.read_bytes()[:-1])
    assert ask("whole again") == "whole again"
    assert derived_text(FOLDERS, LIBRARY, b"pendulum", never) == "whole again"


def test_without_a_cache_every_text_is_derived(package, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert [ask("one"), ask("two")] == ["one", "two"]


def test_a_folder_open_to_others_is_not_trusted(package):
    assert ask("kept") == "kept"
    folder = derivation_cache.cache_directory()
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o770)
    assert [ask("one"), ask("two")] == ["one", "two"]
    folder.chmod(0o700)
    assert ask("anything") == "kept"


def test_a_cache_that_cannot_be_written_is_still_read(package, monkeypatch):
    def refuse(file, text):
        raise PermissionError(file)

    assert ask("kept") == "kept"
    monkeypatch.setattr(derivation_cache, "_write", refuse)
    assert ask("anything") == "kept"
    assert [ask("one", b"new"), ask("two", b"new")] == ["one", "two"]


def test_a_relative_cache_folder_is_ignored(package, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_CACHE_HOME", "cache")
    assert derivation_cache.cache_directory() == tmp_path / "home" / ".cache" / "mrac_design"


def test_what_cannot_be_derived_is_tried_once_and_kept_never(package):
    tries = []

    def derive() -> str:
        tries.append(1)
        raise RuntimeError("singular")

    with pytest.raises(RuntimeError, match="singular"):
        derived_text(FOLDERS, LIBRARY, b"pendulum", derive)
    assert len(tries) == 1
    assert not list(derivation_cache.cache_directory().iterdir())


def test_releases_are_those_of_the_libraries():
    assert scipy.__version__ in derivation_cache.scipy_release()
    assert ca.CasadiMeta.git_revision() in derivation_cache.casadi_release()


@pytest.mark.parametrize(
    ("module", "folders"),
    [
        ("mrac_design.motion.recorded", {"motion"}),
        ("mrac_design.simulation.program", {"codegen", "simulation"}),
        ("mrac_design.robot.equations", {"robot"}),
    ],
)
def test_what_derives_loads_nothing_from_outside_its_folders(module, folders):
    code = f"import sys, {module}\nprint(*(n for n in sys.modules if n.startswith('mrac_design.')))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.split(".")[1] for name in done.stdout.split() if name.count(".") > 1}
    assert loaded <= folders


def test_kept_programs_are_the_written_ones(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    system = pendulum()
    total = ca.Function(
        "total",
        [*system.rate.sx_in(), a := ca.SX.sym("a"), now := ca.SX.sym("now")],
        [a + now],
    )
    choices = [
        (RK4, {"input_powers": 3}),
        (RK4, {"input_powers": 4}),
        (DORMAND_PRINCE_5, {"input_powers": 3}),
        (RK4, {"input_powers": 3, "lanes": 8}),
        (RK4, {"input_powers": 3, "reduction": total}),
    ]
    written = [c_program(system, method, **how) for method, how in choices]
    assert len(set(written)) == len(choices)
    for _ in range(2):
        assert [kept_c_program(system, method, **how) for method, how in choices] == written


def test_kept_functions_of_a_robot_are_the_derived_ones(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    robots = [build_dynamics(load_robot(name)) for name in ("planar_2r", "d2m2_set_a", "planar_2r")]
    functions = [robot.rigid_body_terms.serialize() for robot in robots]
    assert functions[0] == functions[2] != functions[1]
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    assert build_dynamics(load_robot("d2m2_set_a")).rigid_body_terms.serialize() == functions[1]
