from __future__ import annotations

import pytest

from mrac_design.report.tables import Table, comparison_table, torque_table, tracking_table
from mrac_design.simulation.scenario import load_scenario
from tests.report.fakes import fake_study


def cells(table):
    lines = table._repr_markdown_().splitlines()
    rows = [line for line in lines if line.startswith("|") and not set(line) <= set("|:-")]
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in rows]


def test_table_escapes_bars_and_sets_numbers_right():
    table = Table(caption="c", header=("a|b", "n"), rows=(("|x|", "1"),), numeric=(1,))
    assert table._repr_markdown_().splitlines() == [
        "| a\\|b | n |",
        "|:--|--:|",
        "| \\|x\\| | 1 |",
        "",
        ": c",
    ]


def test_comparison_shows_the_paper_and_the_frozen_controller_beside_ours():
    header, *rows = cells(comparison_table(fake_study()))
    assert header == ["axis", "[Z], adaptive", "frozen RST", "adaptive", "adaptive + model inverse"]
    assert [row[0] for row in rows] == ["X", "Y", "Z"]
    stated = "≈ 3 %".replace(" ", "\N{NO-BREAK SPACE}")
    assert all(row[1:] == [stated, "2.4 %", "2.27 %", "0.2 %"] for row in rows)


def test_comparison_leaves_the_paper_out_under_other_conditions():
    study = fake_study()
    study.scenario = load_scenario("reality")
    header, *rows = cells(comparison_table(study))
    assert header == ["axis", "frozen RST", "adaptive", "adaptive + model inverse"]
    assert all(row[1:] == ["2.4 %", "2.27 %", "0.2 %"] for row in rows)


def test_tracking_table_is_in_millinewtons():
    _, *rows = cells(tracking_table(fake_study()))
    assert len(rows) == 9
    assert rows[0] == ["frozen RST", "X", "36", "25.5", "36", "12"]


def test_torque_table_puts_each_motor_beside_its_limit():
    _, *rows = cells(torque_table(fake_study()))
    assert rows[3] == ["joint 4", "20", "2.5", "2.5", "2.5"]
    assert len(rows) == 5


@pytest.mark.parametrize("table", [comparison_table, tracking_table, torque_table])
def test_every_row_is_as_long_as_the_header(table):
    header, *rows = cells(table(fake_study()))
    assert {len(row) for row in rows} == {len(header)}
