"""Where the data that ships with the package lies, in a wheel and in a checkout alike."""

from __future__ import annotations

from pathlib import Path


def models_directory() -> Path:
    """Folder with robots/, motions/ and scenarios/."""
    return _packaged("models")


def notebooks_directory() -> Path:
    """Folder with the notebooks the report is made of."""
    return _packaged("notebooks")


def _packaged(name: str) -> Path:
    package = Path(__file__).parent
    inside_wheel = package / name
    return inside_wheel if inside_wheel.is_dir() else package.parent / name
