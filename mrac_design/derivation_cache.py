"""Texts that take long to derive, kept between processes by all that they were derived from."""

from __future__ import annotations

import hashlib
import logging
import os
import sys
from collections.abc import Callable, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from mrac_design import LOADED_AT

_LOG = logging.getLogger(__name__)
_PACKAGE = Path(__file__).parent
_GRAIN = 20_000_000
"""What a file's time may lag behind the clock (ns)."""


def cache_directory() -> Path:
    """The user's folder for what can be made again; everything in it may be deleted at any time.

    What lies in it is run, so nobody else may write there. Raises OSError when it cannot be made
    or is open to others, and RuntimeError when the user has no home folder.
    """
    base = os.environ.get("XDG_CACHE_HOME", "")
    folder = (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "mrac_design"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if os.name == "posix":
        found = folder.stat()
        if found.st_uid not in (0, os.geteuid()) or found.st_mode & 0o022:
            raise PermissionError(f"{folder}: others may write there; chmod 700 or remove it")
    return folder


def derived_text(
    folders: Sequence[str], library: str, content: bytes, derive: Callable[[], str]
) -> str:
    """The text that `derive` returns, read back where a process has derived it before.

    It must follow from `content`, a `library` (its release), NumPy and the package's Python
    files, of its folders only those in `folders`: when any of them differs the text is derived
    anew. Any number of processes may ask at once. Where the cache cannot be used, and in a process
    whose Python files have changed since it loaded them, the text is derived every time.
    """
    try:
        sources = Sources(_PACKAGE, folders, loaded_at=LOADED_AT)
        file = cache_directory() / f"{_key(sources.digest(), library, content)}.derived"
        usable = sources.as_loaded()
        kept = _read(file) if usable else None
    except (OSError, RuntimeError) as problem:
        _LOG.info("no cache for what is derived (%s)", problem)
        usable, kept = False, None
    if kept is not None:
        return kept
    text = derive()
    try:
        # Some of the files were loaded only now: they must be what the key was made of.
        if usable and sources.as_loaded():
            _write(file, text)
    except OSError as problem:
        _LOG.info("cannot keep what was derived (%s)", problem)
    return text


class Sources:
    """The Python files of a package itself and of all in some of its folders."""

    def __init__(self, package: Path, folders: Sequence[str], *, loaded_at: int) -> None:
        self._package = package
        self._folders = tuple(folders)
        self._loaded_at = loaded_at
        self._files = self._found()

    def digest(self) -> str:
        """SHA-256 of names and contents."""
        return _digest(self._package, self._files)

    def as_loaded(self) -> bool:
        """Whether no file was changed, added or taken away since this process began to load."""
        files = self._found()
        if files != self._files or any(not found for found in files):
            return False
        every = [file for found in files for file in found]
        times = (file.stat() for file in every)
        newest = max(max(time.st_mtime_ns, time.st_ctime_ns) for time in times)
        return newest < self._loaded_at - _GRAIN and self._in_memory() <= set(map(str, every))

    def _found(self) -> tuple[tuple[Path, ...], ...]:
        folders = (self._package / folder for folder in self._folders)
        groups = (self._package.glob("*.py"), *(folder.rglob("*.py") for folder in folders))
        return tuple(tuple(sorted(group)) for group in groups)

    def _in_memory(self) -> set[str]:
        """Files of the modules in memory that these folders hold or held."""
        folders = tuple(f"{self._package / folder}{os.sep}" for folder in self._folders)
        files = (str(getattr(module, "__file__", "")) for module in tuple(sys.modules.values()))
        package = str(self._package)
        return {f for f in files if f.startswith(folders) or os.path.dirname(f) == package}


def casadi_release() -> str:
    """CasADi's version, down to the revision."""
    import casadi as ca

    return f"CasADi {ca.CasadiMeta.version()} {ca.CasadiMeta.git_revision()}"


@cache
def scipy_release() -> str:
    """What SciPy says of its version, without loading it where that can be had."""
    spec = find_spec("scipy")
    file = Path(spec.origin).with_name("version.py") if spec and spec.origin else None
    if file is not None and file.is_file():
        return file.read_text(encoding="utf-8")
    import scipy

    return f"SciPy {scipy.__version__}"


def _key(digest: str, library: str, content: bytes) -> str:
    python = f"Python {sys.version}, NumPy {np.__version__}"
    key = hashlib.sha256()
    for part in (digest.encode(), python.encode(), library.encode(), content):
        key.update(len(part).to_bytes(8, "big") + part)
    return key.hexdigest()[:32]


@cache
def _digest(package: Path, files: tuple[tuple[Path, ...], ...]) -> str:
    digest = hashlib.sha256()
    for file in (file for found in files for file in found):
        digest.update(f"{file.relative_to(package).as_posix()}\n".encode())
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


def _read(file: Path) -> str | None:
    """A kept text; None when it is not there, or is not what was written."""
    try:
        checksum, _, text = file.read_bytes().partition(b"\n")
    except FileNotFoundError:
        return None
    return text.decode() if checksum == _checksum(text) else None


def _write(file: Path, text: str) -> None:
    import tempfile  # takes longer to load than a kept text to read

    descriptor, scratch = tempfile.mkstemp(dir=file.parent)
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(_checksum(text.encode()) + b"\n" + text.encode())
        # Renaming is atomic: another process sees the whole text or none.
        os.replace(scratch, file)
    finally:
        Path(scratch).unlink(missing_ok=True)


def _checksum(text: bytes) -> bytes:
    return hashlib.sha256(text).hexdigest().encode()
