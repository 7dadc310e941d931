"""Where the commands write: results to standard output, everything else to the error stream."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

OUTPUT = Console()
"""Standard output, for results."""
MESSAGES = Console(stderr=True)
"""The error stream, for errors, warnings and progress."""


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A bar on the error stream; the callback takes what is being done and the finished share."""
    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn()
    with Progress(*columns, TimeElapsedColumn(), console=MESSAGES, transient=True) as bar:
        task = bar.add_task(title, total=1.0)
        yield lambda message, share: bar.update(task, description=message, completed=share)


def json_text(content: Mapping[str, Any]) -> str:
    """The content as indented JSON, ending in a newline."""
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def print_json(content: Mapping[str, Any]) -> None:
    """Write the content as JSON to standard output."""
    sys.stdout.write(json_text(content))
