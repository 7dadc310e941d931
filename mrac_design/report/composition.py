"""Executed notebooks become one Pandoc Markdown document and a folder of pictures."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import pypandoc

if TYPE_CHECKING:
    from nbformat import NotebookNode

_TERMINAL_COLOUR = re.compile(r"\x1b\[[0-9;]*m")
_PIPE_TABLES = "markdown-simple_tables-multiline_tables-grid_tables"
_PICTURES = {"image/svg+xml": "svg", "image/png": "png", "image/jpeg": "jpg"}


def compose_markdown(notebook: NotebookNode, stem: str, folder: Path) -> str:
    """The cells and outputs of an executed `notebook` in Pandoc Markdown.

    Pictures are written to `folder` under names that begin with `stem`. Code is marked with
    the class `cell`, so that a filter can fold it (HTML) or leave it out (PDF).
    """
    return "\n\n".join(_blocks(notebook, stem, folder)) + "\n"


def _blocks(notebook: NotebookNode, stem: str, folder: Path) -> Iterator[str]:
    for index, cell in enumerate(notebook.cells):
        if cell.cell_type == "markdown":
            yield cell.source
        elif cell.cell_type == "code" and cell.source.strip():
            yield _fenced(cell.source, "{.python .cell}")
            for position, output in enumerate(cell.outputs):
                yield _output(output, f"{stem}-{index + 1}-{position + 1}", folder)


def _output(output: NotebookNode, name: str, folder: Path) -> str:
    if output.output_type == "stream":
        return _fenced(_plain(output.text).rstrip(), "{.output}")
    data: Mapping[str, str] = output.get("data", {})
    for media_type, suffix in _PICTURES.items():
        if media_type in data:
            caption = output.metadata.get(media_type, {}).get("caption", "")
            return _picture(data[media_type], folder / f"{name}.{suffix}", caption)
    if "text/markdown" in data:
        return data["text/markdown"]
    if "text/latex" in data:
        return _display_equation(data["text/latex"])
    if "text/html" in data:
        return pypandoc.convert_text(data["text/html"], _PIPE_TABLES, format="html").strip()
    return _fenced(_plain(data.get("text/plain", "")), "{.output}")


def _picture(content: str, path: Path, caption: str) -> str:
    if path.suffix == ".svg":
        path.write_text(content, encoding="utf-8")
    else:
        path.write_bytes(base64.b64decode(content))
    line = " ".join(caption.split())
    # Without a caption the trailing backslash keeps Pandoc from numbering it as a figure.
    return f"![{line}]({path.name})" + ("" if line else "\\")


def _display_equation(latex: str) -> str:
    body = latex.strip().strip("$").strip()
    return f"$$\n{body.removeprefix(chr(92) + 'displaystyle').strip()}\n$$"


def _fenced(text: str, attributes: str) -> str:
    longest = max((len(run) for run in re.findall(r"`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    return f"{fence} {attributes}\n{text}\n{fence}"


def _plain(text: str) -> str:
    return _TERMINAL_COLOUR.sub("", text)
