"""Run a notebook kept as text in a kernel of the interpreter that is running now."""

from __future__ import annotations

import asyncio
import atexit
import json
import os
import re
import sys
from collections.abc import Callable, Coroutine, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import jupytext
from jupyter_client.kernelspec import KernelSpecManager
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, DeadKernelError
from nbformat import NotebookNode

from mrac_design.errors import NotebookError

_KERNEL = "mrac-report"
_TERMINAL_COLOUR = re.compile(r"\x1b\[[0-9;]*m")


def read_notebook(path: Path) -> NotebookNode:
    """Read a jupytext notebook; raises NotebookError when there is none at `path`."""
    try:
        return jupytext.read(path, fmt="py:percent" if path.suffix == ".py" else None)
    except (OSError, UnicodeDecodeError, ValueError) as problem:
        raise NotebookError(path, "cannot be read", str(problem)) from problem


def execute_notebooks(
    paths: Sequence[Path],
    folder: Path,
    environment: Mapping[str, str],
    cells_done: Callable[[str, float], None],
) -> list[NotebookNode]:
    """Execute notebooks side by side, each in a kernel of its own; outputs fill their cells.

    `folder` is an existing scratch folder: working directories, kernel descriptions and
    connection files lie there, so no kernel need be installed and no home be writable.
    `environment` is added to the kernels' environment variables. `cells_done(name, fraction of
    all cells)` is called after each cell. The first failure ends all of them; raises
    NotebookError naming notebook, cell and exception.
    """
    notebooks = [read_notebook(path) for path in paths]
    total = sum(len(notebook.cells) for notebook in notebooks) or 1
    finished = 0

    def cell_done(path: Path) -> None:
        nonlocal finished
        finished += 1
        cells_done(path.name, finished / total)

    async def execute_all() -> None:
        async with asyncio.TaskGroup() as group:
            for number, (path, notebook) in enumerate(zip(paths, notebooks, strict=True)):
                scratch = folder / f"run-{number}"
                scratch.mkdir()
                group.create_task(
                    _execute(path, notebook, scratch, environment, partial(cell_done, path))
                )

    try:
        _run_in_thread(execute_all())
    except* NotebookError as failures:
        # Those after the first are the other notebooks, cancelled on its account.
        raise failures.exceptions[0] from None
    return notebooks


def _run_in_thread(work: Coroutine[None, None, None]) -> None:
    """Run `work` in an event loop of its own; an interruption here cancels it there.

    A thread, because the caller may be inside an event loop (a notebook), and because nbclient
    takes over the signals of the main thread.
    """
    tasks: list[asyncio.Task[None]] = []

    async def registered() -> None:
        tasks.append(asyncio.ensure_future(work))
        await tasks[0]

    with ThreadPoolExecutor(1) as pool:
        result = pool.submit(asyncio.run, registered())
        try:
            result.result()
        except KeyboardInterrupt:
            for task in tasks:
                task.get_loop().call_soon_threadsafe(task.cancel)
            raise


async def _execute(
    path: Path,
    notebook: NotebookNode,
    scratch: Path,
    environment: Mapping[str, str],
    cell_done: Callable[[], None],
) -> None:
    client = NotebookClient(
        notebook,
        km=_kernel_manager(scratch),
        timeout=None,
        resources={"metadata": {"path": str(scratch)}},
    )
    log_file = scratch / "kernel.log"
    with log_file.open("wb") as log:
        options = {"env": _kernel_environment(scratch, environment), "stdout": log, "stderr": log}
        try:
            async with client.async_setup_kernel(cleanup_kc=True, **options):
                for index, cell in enumerate(notebook.cells):
                    await _execute_cell(client, path, cell, index)
                    cell_done()
        except (RuntimeError, OSError) as problem:
            # nbclient leaves this behind when a kernel does not start; at exit it would fail.
            atexit.unregister(client._cleanup_kernel)
            said = log_file.read_text(errors="replace").strip().splitlines() or [str(problem)]
            raise NotebookError(path, "the Python kernel did not start", said[-1]) from problem


async def _execute_cell(client: NotebookClient, path: Path, cell: NotebookNode, index: int) -> None:
    place = f"cell {index + 1} ({_first_line(cell.source)})"
    try:
        await client.async_execute_cell(cell, index)
    except CellExecutionError as failure:
        raise NotebookError(path, place, _exception_text(failure)) from None
    except DeadKernelError as failure:
        raise NotebookError(path, place, "the Python kernel died") from failure


def _kernel_manager(folder: Path) -> AsyncKernelManager:
    specification = folder / "kernels" / _KERNEL
    specification.mkdir(parents=True, exist_ok=True)
    launch = [sys.executable, "-Xfrozen_modules=off", "-m", "ipykernel_launcher"]
    quiet = ["--HistoryManager.enabled=False", "--IPKernelApp.log_level=ERROR"]
    arguments = [*launch, "-f", "{connection_file}", *quiet]
    description = {"argv": arguments, "display_name": _KERNEL, "language": "python"}
    (specification / "kernel.json").write_text(json.dumps(description), encoding="utf-8")
    return AsyncKernelManager(
        kernel_name=_KERNEL,
        kernel_spec_manager=KernelSpecManager(kernel_dirs=[str(folder / "kernels")]),
        connection_file=str(folder / "connection.json"),
    )


def _kernel_environment(folder: Path, environment: Mapping[str, str]) -> dict[str, str]:
    """The caller's environment, without its display and its personal IPython start-up files."""
    package_parent = str(Path(__file__).resolve().parents[2])
    search_path = [package_parent, os.environ.get("PYTHONPATH", "")]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(entry for entry in search_path if entry),
        "PYDEVD_DISABLE_FILE_VALIDATION": "1",
        "MPLBACKEND": "module://matplotlib_inline.backend_inline",
        "IPYTHONDIR": str(folder / "ipython"),
        **environment,
    }


def _first_line(source: str) -> str:
    line = next((line.strip() for line in source.splitlines() if line.strip()), "empty")
    return f"'{line}'"


def _exception_text(failure: CellExecutionError) -> str:
    """Exception, its message and the line that raised it; a bare assertion has only the line."""
    text = f"{failure.ename}: {failure.evalue}" if failure.evalue else failure.ename
    marked = ""
    for line in _TERMINAL_COLOUR.sub("", failure.traceback).splitlines():
        found = re.match(r"-+> (\d+) (.*)", line)
        if found and not marked:
            marked = f" at line {found[1]} of the cell: {found[2].strip()}"
    return _TERMINAL_COLOUR.sub("", text) + marked
