"""`mrac export`: what it writes, and what it refuses in one sentence."""

from __future__ import annotations

import json

import pytest
import typer
from typer.testing import CliRunner

from mrac_design.cli.export import export
from mrac_design.errors import MracDesignError
from mrac_design.export.gains import read_gains
from tests.export.gain_sets import nominal_gain_set

app = typer.Typer()
app.command()(export)


def run(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None:
        raise result.exception
    return result.stdout


def test_gains_in_every_format_and_formulas(tmp_path):
    files = [tmp_path / "out" / f"gains{s}" for s in (".json", ".toml", ".yaml", ".mat")]
    wanted = [word for file in files for word in ("--gains", file)]
    done = json.loads(run(*wanted, "--latex", tmp_path / "formulas.tex", "--json"))
    assert {read_gains(file) for file in files} == {nominal_gain_set()}
    assert len({done[f"gains {file}"]["hash"] for file in files}) == 1
    assert (tmp_path / "formulas.tex").stat().st_size > 5000
    assert not list(tmp_path.rglob(".mrac-*"))


def test_options_change_what_is_exported(tmp_path):
    file = tmp_path / "gains.json"
    run("--gains", file, "--omega", 300, "--gain", 0.5, "--controller", "adaptive")
    gains = read_gains(file)
    assert gains.specification.reference_model.bandwidth == 300.0
    assert gains.law.gain == 0.5
    assert run("--gains", file) != ""
    assert read_gains(file) == nominal_gain_set()


def test_a_gains_file_gives_the_fmu_the_scenario_gives(tmp_path):
    run("--gains", tmp_path / "gains.yaml", "--fmu", tmp_path / "one.fmu", "--rate", 2000)
    run("--from", tmp_path / "gains.yaml", "--fmu", tmp_path / "two.fmu", "--rate", 2000)
    assert (tmp_path / "one.fmu").read_bytes() == (tmp_path / "two.fmu").read_bytes()


def test_a_c_package_of_a_gains_file(tmp_path):
    run("--gains", tmp_path / "gains.toml")
    folder = tmp_path / "controller"
    done = json.loads(run("--from", tmp_path / "gains.toml", "--c", folder, "--json"))
    text = (folder / "mrac_controller.h").read_text()
    assert (
        json.loads(run("--gains", tmp_path / "g.json", "--json"))[f"gains {tmp_path / 'g.json'}"][
            "hash"
        ]
        in text
    )
    assert done["c"]["state_bytes"] > 0


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ((), "name what to write"),
        (("--gains", "a.xml"), "must end in"),
        (("--fmu", "a.fmu", "--rate", "0"), "rate"),
        (("--fmu", "a.fmu", "--robot", "nowhere"), "nowhere"),
        (("--from", "nowhere.json", "--gains", "a.json"), "cannot be read"),
        (("--from", "gains.json", "--omega", "3", "--gains", "a.json"), "bandwidth|omega"),
        (("--from", "gains.json", "--controller", "frozen", "--gains", "a.json"), "controller"),
        (("--from", "gains.json", "--robot", "planar_2r", "--fmu", "a.fmu"), "not the robot"),
        (("--from", "gains.json", "--robot", "planar_2r", "--latex", "a.tex"), "not the robot"),
        (("--from", "spoiled.json", "--latex", "a.tex"), "changed after it was written"),
    ],
)
def test_what_cannot_be_exported_is_one_clear_error(tmp_path, monkeypatch, arguments, names):
    monkeypatch.chdir(tmp_path)
    run("--gains", "gains.json")
    text = (tmp_path / "gains.json").read_text("utf-8")
    (tmp_path / "spoiled.json").write_text(text.replace("846.875", "846.876"), "utf-8")
    with pytest.raises(MracDesignError, match=names) as caught:
        run(*arguments)
    assert "\n" not in str(caught.value)
    assert {path.name for path in tmp_path.iterdir()} == {"gains.json", "spoiled.json"}
