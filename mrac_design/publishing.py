"""Output appears whole or not at all: work happens beside the target, then is renamed."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def staging_folder(target: Path) -> Iterator[Path]:
    """A hidden temporary folder on the file system of `target`, removed on leaving.

    It lies in the nearest existing ancestor, so that not even the parents of `target`
    are made when the work inside fails.
    """
    ancestor = target.absolute().parent
    while not ancestor.is_dir():
        ancestor = ancestor.parent
    folder = Path(tempfile.mkdtemp(prefix=".mrac-", dir=ancestor))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def publish_file(staged: Path, target: Path) -> None:
    """Rename a finished file onto `target`, replacing an older one in a single step."""
    target.parent.mkdir(parents=True, exist_ok=True)
    staged.replace(target)


def publish_folder(staged: Path, target: Path) -> None:
    """Rename a finished folder to `target`; an older folder is put back if that fails."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if not target.exists():
        staged.replace(target)
        return
    previous = staged.with_name(staged.name + "-previous")
    target.replace(previous)
    try:
        staged.replace(target)
    except OSError:
        previous.replace(target)
        raise
    shutil.rmtree(previous, ignore_errors=True)


def publish_contents(staged: Path, target: Path) -> None:
    """Rename everything finished in the folder `staged` into `target`, entry by entry."""
    for finished in sorted(staged.iterdir()):
        publish = publish_folder if finished.is_dir() else publish_file
        publish(finished, target / finished.name)
