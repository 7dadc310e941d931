"""Writing one file of an export: whole or not at all, and one error when it cannot be."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mrac_design.errors import FileError
from mrac_design.publishing import publish_file, staging_folder


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """A file to write instead of `path`; on leaving it becomes `path` in a single step.

    It lies alone in a folder of its own, removed on leaving. Raises FileError when the file
    system refuses.
    """
    try:
        with staging_folder(path) as folder:
            staged = folder / path.name
            yield staged
            publish_file(staged, path)
    except OSError as problem:
        raise FileError(path, "", f"cannot be written: {problem.strerror or problem}") from problem
