"""Compiling generated C, once per content and machine."""

from __future__ import annotations

import atexit
import ctypes
import errno
import hashlib
import logging
import os
import platform
import shlex
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

from mrac_design.derivation_cache import cache_directory
from mrac_design.errors import CompilationError

_LOG = logging.getLogger(__name__)
# No contraction and no reassociation beyond what the source asks for: the same bits on every rerun
# and in every lane.
_FLAGS = (
    "-std=gnu99", "-O3", "-march=native", "-ffp-contract=off",
    "-fno-math-errno", "-fno-trapping-math", "-fPIC", "-shared",
)  # fmt: skip
_X86_FLAGS = ("-mprefer-vector-width=512",)
# What gcc leaves out on x86 and clang does anyway: a fifth faster on straight-line code.
_GCC_FLAGS = ("-fschedule-insns", "-fsched-pressure")
_TIME_LIMIT = 600.0
"""Seconds after which a compiler is given up."""


def find_compiler() -> str | None:
    """The C compiler: $CC if set (it may hold options), else the first of cc, gcc, clang."""
    chosen = os.environ.get("CC", "").strip()
    if chosen:
        name, *options = shlex.split(chosen)
        path = shutil.which(name)
        if path is None:
            _LOG.warning("the compiler named by CC, '%s', is not there", chosen)
            return None
        return shlex.join([path, *options])
    return next((path for name in ("cc", "gcc", "clang") if (path := shutil.which(name))), None)


def compile_library(source: str, compiler: str) -> ctypes.CDLL:
    """Load the shared library of `source`, from the cache when it was compiled before.

    Any number of processes may do so at once. Where the user's cache cannot be written or the
    disk is full, a private folder serves. Raises CompilationError with the compiler's first error
    when it refuses the source, and when there is no folder to write to.
    """
    command = shlex.split(compiler)
    compiler_version = _version(compiler)
    flags: tuple[str, ...] = _FLAGS
    if platform.machine() in ("x86_64", "AMD64"):
        flags += _X86_FLAGS
    if "clang" not in compiler_version.lower():
        flags += _GCC_FLAGS
    key = "\n".join((source, " ".join(flags), compiler, compiler_version, _processor()))
    name = f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.so"
    obstacles = []
    for find_directory in (cache_directory, _private_directory):
        try:
            library = find_directory() / name
            if library.exists():
                try:
                    return ctypes.CDLL(str(library))
                except OSError:
                    _LOG.info("%s is damaged: compiled anew", library)
            _compile(source, command, flags, library)
            return ctypes.CDLL(str(library))
        except (OSError, RuntimeError) as problem:
            _LOG.info("cannot keep compiled code (%s)", problem)
            obstacles.append(str(problem))
    raise CompilationError(command, f"nowhere to keep the compiled code: {'; '.join(obstacles)}")


def _compile(source: str, command: list[str], flags: tuple[str, ...], library: Path) -> None:
    library.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=library.parent, ignore_cleanup_errors=True) as scratch:
        c_file, built = Path(scratch) / "program.c", Path(scratch) / "program.so"
        c_file.write_text(source, encoding="utf-8")
        full = [*command, *flags, str(c_file), "-o", str(built), "-lm"]
        # Its own intermediate files lie beside the source, not in a temporary folder that may be
        # smaller or not ours.
        environment = {**os.environ, "TMPDIR": scratch, "LC_ALL": "C"}
        try:
            result = subprocess.run(
                full,
                capture_output=True, text=True, check=False, timeout=_TIME_LIMIT, env=environment,
            )  # fmt: skip
        except subprocess.TimeoutExpired as problem:
            raise CompilationError(full, f"no answer in {_TIME_LIMIT:.0f} s") from problem
        if os.strerror(errno.ENOSPC) in result.stderr:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(library.parent))
        if result.returncode != 0 or not built.exists():
            raise CompilationError(full, result.stderr or "it wrote no library")
        # Renaming is atomic: another process sees the whole library or none.
        built.replace(library)


@cache
def _private_directory() -> Path:
    """A folder of this process alone, removed when it ends."""
    folder = Path(tempfile.mkdtemp(prefix="mrac_design-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@cache
def _version(compiler: str) -> str:
    try:
        result = subprocess.run(
            [*shlex.split(compiler), "--version"],
            capture_output=True, text=True, check=False, timeout=60,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as problem:
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
