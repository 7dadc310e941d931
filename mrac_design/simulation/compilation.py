"""Compiling generated C, once per content and machine."""

from __future__ import annotations

import ctypes
import hashlib
import logging
import os
import platform
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

from mrac_design.errors import CompilationError

_LOG = logging.getLogger(__name__)
# No contraction and no reassociation: the same bits as CasADi's own machine on every rerun.
_FLAGS = (
    "-std=c99", "-O3", "-march=native", "-ffp-contract=off",
    "-fno-math-errno", "-fno-trapping-math", "-mprefer-vector-width=512", "-fPIC", "-shared",
)  # fmt: skip


def find_compiler() -> str | None:
    """Path of the C compiler: $CC if set, else the first of cc, gcc, clang on the PATH."""
    candidates = [os.environ["CC"]] if os.environ.get("CC") else ["cc", "gcc", "clang"]
    return next((path for name in candidates if (path := shutil.which(name))), None)


def compile_library(source: str, compiler: str) -> ctypes.CDLL:
    """Load the shared library of `source`, from the cache when it was compiled before.

    Raises CompilationError with the compiler's first message when it refuses the source.
    """
    flags = (*_FLAGS, "-lm")
    key = "\n".join((source, " ".join(flags), compiler, _version(compiler), _processor()))
    name = f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.so"
    for directory in _cache_directories():
        library = directory / name
        try:
            if not library.exists():
                _compile(source, compiler, flags, library)
            return ctypes.CDLL(str(library))
        except OSError as problem:
            _LOG.info("cannot keep compiled code in %s (%s)", directory, problem)
    raise CompilationError([compiler], "no folder to keep the compiled library in")


def _compile(source: str, compiler: str, flags: tuple[str, ...], library: Path) -> None:
    library.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=library.parent) as scratch:
        c_file, built = Path(scratch) / "program.c", Path(scratch) / "program.so"
        c_file.write_text(source)
        command = [compiler, str(c_file), "-o", str(built), *flags]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        if result.returncode != 0:
            raise CompilationError(command, result.stderr)
        # Renaming is atomic: another process sees the whole library or none.
        built.replace(library)


def _cache_directories() -> tuple[Path, Path]:
    """The user's cache, and a private temporary folder where that cannot be written."""
    home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "mrac_design", _private_directory()


@cache
def _private_directory() -> Path:
    return Path(tempfile.mkdtemp(prefix="mrac_design-"))


@cache
def _version(compiler: str) -> str:
    try:
        result = subprocess.run(
            [compiler, "--version"], capture_output=True, text=True, check=False
        )
    except OSError as problem:
        raise CompilationError([compiler, "--version"], str(problem)) from problem
    return result.stdout.partition("\n")[0]


@cache
def _processor() -> str:
    """What -march=native depends on."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith(("flags", "Features")):
                return line
    except OSError:
        pass
    return f"{platform.machine()} {platform.processor()}"
