"""Run a notebook kept as text in a kernel of the interpreter that is running now."""

from __future__ import annotations

import contextlib
import json
import os
import re
import sys
from collections.abc import Callable, Mapping
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


def execute_notebook(
    path: Path,
    folder: Path,
    environment: Mapping[str, str],
    cell_done: Callable[[int, int], None],
) -> NotebookNode:
    """Execute the notebook at `path` and return it with the outputs of its cells.

    `folder` is an existing scratch folder: working directory, kernel description and
    connection file lie there, so no kernel need be installed and no home be writable.
    `environment` is added to the kernel's environment variables. `cell_done(cells done, cells)`
    is called after each cell. Raises NotebookError naming the cell and its exception.
    """
    notebook = read_notebook(path)
    client = NotebookClient(
        notebook,
        km=_kernel_manager(folder),
        timeout=None,
        resources={"metadata": {"path": str(folder)}},
    )
    count = len(notebook.cells)
    try:
        with client.setup_kernel(env=_kernel_environment(folder, environment)):
            for index, cell in enumerate(notebook.cells):
                _execute_cell(client, path, cell, index)
                cell_done(index + 1, count)
    except (RuntimeError, OSError) as problem:
        raise NotebookError(path, "the Python kernel did not start", str(problem)) from problem
    return notebook


def _execute_cell(client: NotebookClient, path: Path, cell: NotebookNode, index: int) -> None:
    place = f"cell {index + 1} ({_first_line(cell.source)})"
    try:
        client.execute_cell(cell, index)
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
    with contextlib.suppress(UnicodeError):
        text = _TERMINAL_COLOUR.sub("", text)
    return text + marked
