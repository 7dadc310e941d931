"""Where the commands write: results to standard output, everything else to the error stream.

Rich loads with the first line it shapes: what prints JSON alone needs none of it.
"""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console


@cache
def output() -> Console:
    """Standard output, for results."""
    from rich.console import Console

    return Console()


@cache
def messages() -> Console:
    """The error stream, for errors, warnings and progress."""
    from rich.console import Console

    return Console(stderr=True)


class MessageHandler(logging.Handler):
    """Log records on the error stream, above a running progress bar."""

    def emit(self, record: logging.LogRecord) -> None:
        from rich.logging import RichHandler

        RichHandler(console=messages(), show_time=False, show_path=False).emit(record)


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A bar on the error stream; the callback takes what is being done and the finished share."""
    if not sys.stderr.isatty():
        yield lambda message, share: None
        return
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn()
    with Progress(*columns, TimeElapsedColumn(), console=messages(), transient=True) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda message, share: bar.update(task, description=message, completed=share)


def json_text(content: Mapping[str, Any]) -> str:
    """The content as indented JSON, ending in a newline."""
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def print_json(content: Mapping[str, Any]) -> None:
    """Write the content as JSON to standard output."""
    sys.stdout.write(json_text(content))
