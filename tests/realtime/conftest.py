from __future__ import annotations

import shutil
import sys

import pytest

from mrac_design.export import c_counts
from mrac_design.realtime import run_realtime
from mrac_design.simulation.compilation import find_compiler
from tests.realtime.small_scenario import built_program, small_experiment, small_scenario


def pytest_collection_modifyitems(items):
    able = sys.platform.startswith("linux") and find_compiler() is not None
    for item in items:
        if not able and "tests/realtime" in item.path.as_posix():
            item.add_marker(pytest.mark.skip(reason="needs Linux and a C compiler"))


@pytest.fixture(scope="session")
def report():
    """Two rates; the second one's period is no whole number of microseconds."""
    return run_realtime(small_scenario(), rates=[1000.0, 1300.0])


@pytest.fixture(scope="session")
def experiment():
    return small_experiment(1000.0)


@pytest.fixture(scope="session")
def program(experiment, tmp_path_factory):
    return built_program(experiment, tmp_path_factory.mktemp("realtime"))


@pytest.fixture
def uncounted(monkeypatch):
    """Instructions are not counted: it takes a second."""
    monkeypatch.setattr(c_counts, "find_compiler", lambda: None)


@pytest.fixture
def own_program(program, tmp_path):
    """The program in a folder of this test's own."""
    return shutil.copy(program, tmp_path / "realtime")
