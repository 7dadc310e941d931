from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path

import pytest

from mrac_design.errors import NotebookError, RenderingError
from mrac_design.report.rendering import render_report

NOTEBOOK = """
# %% [markdown]
# # First stage
# Prose with $\\dot\\theta = \\gamma\\varphi\\varepsilon$.

# %%
import os
from pathlib import Path
from mrac_design.report.style import new_figure
print("scenario is", Path(os.environ["MRAC_SCENARIO"]).read_text())

# %%
class Table:
    def _repr_markdown_(self):
        return "| quantity | value |\\n|:--|--:|\\n| stiffness | 800 |\\n\\n: Numbers"
Table()

# %%
figure = new_figure(2, "Caption of a figure")
figure.subplots().plot([0, 1], [0, 1])
figure

# %%
class OnlyHtml:
    def _repr_html_(self):
        return "<table><tr><th>head</th></tr><tr><td>1 &lt; 2</td></tr></table>"
OnlyHtml()
"""


class Page(HTMLParser):
    """Addresses a page would load, and its text."""

    def __init__(self, text):
        super().__init__()
        self.loads, self.text = [], ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        wanted = {"src", "srcset", "data"} | ({"href"} if tag == "link" else set())
        self.loads += [value for name, value in attributes if name in wanted]

    def handle_data(self, data):
        self.text += data


@pytest.fixture
def scenario(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("forty-two")
    return path


def render(folder, scenario, notebooks, progress=lambda message, fraction: None):
    out = folder / "out"
    render_report(
        notebooks,
        title="A title",
        subtitle="A subtitle",
        scenario=scenario,
        html=out / "report.html",
        pdf=out / "report.pdf",
        progress=progress,
    )
    return out


def write(folder, text, name="01_stage.py"):
    path = folder / name
    path.write_text(text)
    return path


def leftovers(folder):
    return {path.name for path in folder.iterdir()} - {"mine.toml", "01_stage.py", "02_stage.py"}


def test_report_is_complete_self_contained_and_in_order(tmp_path, scenario):
    second = write(tmp_path, "# %% [markdown]\n# # Second stage\n\n# %%\n1 + 1\n", "02_stage.py")
    fractions = []
    out = render(
        tmp_path,
        scenario,
        [write(tmp_path, NOTEBOOK), second],
        lambda message, fraction: fractions.append(fraction),
    )
    assert sorted(path.name for path in out.iterdir()) == ["report.html", "report.pdf"]
    assert leftovers(tmp_path) == {"out"}
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0

    html = (out / "report.html").read_text()
    page = Page(html)
    assert page.loads
    assert all(address.startswith("data:") for address in page.loads)
    assert not re.search(r"@import|url\((?!['\"]?data:)", html)
    assert "scenario is forty-two" in page.text
    assert "<math" in html
    assert '<mo accent="true">\N{DOT ABOVE}</mo>' in html  # a combining dot would stand beside θ
    assert not set(html) & {"\N{COMBINING DOT ABOVE}", "\N{COMBINING DIAERESIS}"}
    assert html.index("First stage</h1>") < html.index("Second stage</h1>")
    assert re.search(r"<td[^>]*>stiffness</td>\s*<td[^>]*>800</td>", html)
    assert re.search(r"<th[^>]*>head</th>", html)
    assert "Figure 1." in page.text
    assert html.count('<details class="code">') == 5

    pdf = (out / "report.pdf").read_bytes()
    assert pdf.startswith(b"%PDF-")
    # Title page with the contents, then a page for each chapter.
    assert int(re.search(rb"/Type/Pages/Count (\d+)", pdf)[1]) == 3


@pytest.mark.parametrize(
    ("cell", "complaint"),
    [
        ("x = 1\nassert x == 2", "AssertionError at line 2 of the cell: assert x == 2"),
        ("raise ValueError('no such robot')", "ValueError: no such robot"),
        ("import os\nos._exit(3)", "the Python kernel died"),
    ],
)
def test_failing_cell_is_one_clear_error_and_writes_nothing(tmp_path, scenario, cell, complaint):
    notebook = write(tmp_path, f"# %%\n1 + 1\n\n# %%\n{cell}\n")
    with pytest.raises(NotebookError) as caught:
        render(tmp_path, scenario, [notebook])
    message = str(caught.value)
    assert message.startswith(f"{notebook}: cell 2 ({cell.splitlines()[0]!r})".replace('"', "'"))
    assert complaint in message
    assert "\x1b" not in message
    assert leftovers(tmp_path) == set()


def test_failure_of_one_notebook_ends_the_others(tmp_path, scenario):
    slow = write(tmp_path, "# %%\nimport time\ntime.sleep(60)\n")
    broken = write(tmp_path, "# %%\n1 / 0\n", "02_stage.py")
    begun = time.monotonic()
    with pytest.raises(NotebookError, match=r"02_stage\.py: cell 1 .*ZeroDivisionError"):
        render(tmp_path, scenario, [slow, broken])
    assert time.monotonic() - begun < 30
    assert leftovers(tmp_path) == set()


@pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX script")
def test_kernel_that_cannot_start_is_explained_in_its_own_words(tmp_path, scenario, monkeypatch):
    python = tmp_path / "01_stage.py"
    python.write_text("#!/bin/sh\necho no module named ipykernel >&2\nexit 1\n")
    python.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(python))
    notebook = write(tmp_path, "# %%\n1\n", "02_stage.py")
    with pytest.raises(NotebookError, match="did not start: no module named ipykernel"):
        render(tmp_path, scenario, [notebook])


def test_missing_notebook_is_named_before_anything_runs(tmp_path, scenario):
    with pytest.raises(NotebookError, match=r"absent\.py: no such notebook"):
        render(tmp_path, scenario, [write(tmp_path, "# %%\n1"), tmp_path / "absent.py"])
    assert leftovers(tmp_path) == set()


def test_formula_that_cannot_be_set_is_an_error(tmp_path, scenario):
    notebook = write(tmp_path, "# %% [markdown]\n# $$\\unknown{x}_{{$$\n")
    with pytest.raises(RenderingError, match="html5 could not be made"):
        render(tmp_path, scenario, [notebook])
    assert leftovers(tmp_path) == set()


def test_page_is_not_published_without_its_pdf(tmp_path, scenario, monkeypatch):
    def refuse(*_, **__):
        raise RuntimeError("no such font")

    monkeypatch.setattr("typst.compile", refuse)
    with pytest.raises(RenderingError, match="PDF could not be made: no such font"):
        render(tmp_path, scenario, [write(tmp_path, "# %% [markdown]\n# # One\n")])
    assert leftovers(tmp_path) == set()


def test_older_report_survives_a_failure(tmp_path, scenario):
    out = render(tmp_path, scenario, [write(tmp_path, "# %% [markdown]\n# # One\n")])
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    with pytest.raises(NotebookError):
        render(tmp_path, scenario, [write(tmp_path, "# %%\n1 / 0\n")])
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for other processes")
def test_interrupted_run_leaves_nothing(tmp_path, scenario):
    notebook = write(tmp_path, "# %%\nimport time\ntime.sleep(60)\n")
    program = f"""
from pathlib import Path
from mrac_design.report.rendering import render_report
here = Path({str(tmp_path)!r})
render_report([Path({str(notebook)!r})], title="t", subtitle="", scenario=here / "mine.toml",
              html=here / "out" / "report.html", pdf=here / "out" / "report.pdf")
"""
    process = subprocess.Popen(
        [sys.executable, "-c", program], stderr=subprocess.PIPE, cwd=Path(__file__).parents[2]
    )
    try:
        for _ in range(200):
            if list(tmp_path.glob(".mrac-*/run-0/connection.json")):
                break
            time.sleep(0.05)
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=20)
    finally:
        process.kill()
    assert process.returncode != 0
    assert b"KeyboardInterrupt" in stderr
    assert leftovers(tmp_path) == set()
