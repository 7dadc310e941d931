"""Notebooks → one self-contained HTML page and one PDF, without network."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from datetime import date
from pathlib import Path

import pypandoc
import typst

from mrac_design.errors import NotebookError, RenderingError
from mrac_design.publishing import publish_file, staging_folder
from mrac_design.report.composition import compose_markdown
from mrac_design.report.execution import execute_notebooks

RESULTS_VARIABLE = "MRAC_RESULTS"
"""Environment variable: the folder in which a notebook leaves what else belongs to a report."""

ReportProgress = Callable[[str, float], None]
"""Called with what is being done and the fraction (0…1) of the rendering that is done."""

_TEMPLATES = Path(__file__).parent / "templates"
_MARKDOWN = (
    "markdown-yaml_metadata_block-citations-example_lists-fancy_lists"
    "+lists_without_preceding_blankline"
)
_EXECUTION_SHARE = 0.85
_SPACING = {
    "\N{COMBINING DIAERESIS}": "\N{DIAERESIS}",
    "\N{COMBINING DOT ABOVE}": "\N{DOT ABOVE}",
    "\N{COMBINING CIRCUMFLEX ACCENT}": "\N{MODIFIER LETTER CIRCUMFLEX ACCENT}",
    "\N{COMBINING TILDE}": "\N{SMALL TILDE}",
    "\N{COMBINING MACRON}": "\N{MACRON}",
}
_ACCENT = re.compile(f'(<mo accent="true">)([{"".join(_SPACING)}])(</mo>)')


def ignore_progress(message: str, fraction: float) -> None:
    """A progress callback for callers that show none."""


def render_report(
    notebooks: Sequence[Path],
    *,
    title: str,
    subtitle: str,
    scenario: Path,
    html: Path,
    pdf: Path,
    environment: Mapping[str, str] | None = None,
    progress: ReportProgress = ignore_progress,
) -> None:
    """Execute `notebooks` and write them, in order, as chapters of `html` and `pdf`.

    The notebooks find the path of the `scenario` file in the environment variable
    MRAC_SCENARIO, and what else they are told in the variables of `environment`. Both files
    are complete when they appear; when anything fails, or the run is interrupted, neither is
    touched. Raises NotebookError for a missing or failing notebook, RenderingError when Pandoc
    or Typst refuses the document.
    """
    missing = [path for path in notebooks if not path.is_file()]
    if missing:
        raise NotebookError(missing[0], "", "no such notebook")
    variables = {"MRAC_SCENARIO": str(scenario.absolute()), **(environment or {})}
    with staging_folder(html) as folder:
        source = folder / "report.md"
        source.write_text(_executed_markdown(notebooks, variables, folder, progress), "utf-8")
        metadata = _metadata(title, subtitle)
        progress("writing HTML", _EXECUTION_SHARE)
        page = _write_html(source, metadata)
        progress("writing PDF", 0.9)
        document = _write_pdf(source, metadata)
        with staging_folder(pdf) as beside_pdf:
            # A copy first: the PDF may go to another file system than the page.
            staged = beside_pdf / document.name
            staged.write_bytes(document.read_bytes())
            publish_file(staged, pdf)
        publish_file(page, html)
    progress("report written", 1.0)


def _executed_markdown(
    notebooks: Sequence[Path],
    environment: Mapping[str, str],
    folder: Path,
    progress: ReportProgress,
) -> str:
    executed = execute_notebooks(
        notebooks,
        folder,
        environment,
        lambda name, done: progress(f"running {name}", _EXECUTION_SHARE * done),
    )
    chapters = [
        compose_markdown(notebook, path.stem, folder)
        for path, notebook in zip(notebooks, executed, strict=True)
    ]
    return "\n\n".join(chapters)


def _metadata(title: str, subtitle: str) -> list[str]:
    fields = {
        "title": title,
        "pagetitle": title,
        "subtitle": subtitle,
        "date": date.today().isoformat(),
        "lang": "en",
    }
    return [f"--metadata={key}={value}" for key, value in fields.items()]


def _write_html(source: Path, metadata: list[str]) -> Path:
    target = source.with_suffix(".html")
    options = ["--embed-resources", "--mathml", f"--css={_TEMPLATES / 'report.css'}"]
    options += [f"--template={_TEMPLATES / 'report.html'}", "--syntax-highlighting=tango"]
    _pandoc(source, "html5", target, metadata + options)
    page = target.read_text(encoding="utf-8")
    target.write_text(with_spacing_accents(page), encoding="utf-8")
    return target


def with_spacing_accents(page: str) -> str:
    """An HTML page whose MathML accents are characters of their own.

    Pandoc writes combining ones, which browsers set beside and above the letter they belong to;
    MathML's operator dictionary knows the spacing ones.
    """
    return _ACCENT.sub(lambda found: found[1] + _SPACING[found[2]] + found[3], page)


def _write_pdf(source: Path, metadata: list[str]) -> Path:
    typesetting = source.with_suffix(".typ")
    target = source.with_suffix(".pdf")
    _pandoc(source, "typst", typesetting, [*metadata, f"--template={_TEMPLATES / 'report.typ'}"])
    try:
        # Typst's own fonts only: the same pages on every machine.
        typst.compile(typesetting, output=target, root=source.parent, ignore_system_fonts=True)
    except RuntimeError as problem:
        raise RenderingError("PDF", str(problem)) from problem
    return target


def _pandoc(source: Path, output_format: str, target: Path, options: list[str]) -> None:
    common = ["--standalone", "--toc", "--toc-depth=2", "--number-sections", "--columns=10000"]
    common += ["--fail-if-warnings", f"--resource-path={source.parent}"]
    common += [f"--lua-filter={_TEMPLATES / 'cells.lua'}"]
    try:
        pypandoc.convert_file(
            source, output_format, _MARKDOWN, common + options, outputfile=target, cworkdir=None
        )
    except RuntimeError as problem:
        raise RenderingError(output_format, str(problem).strip()) from problem
