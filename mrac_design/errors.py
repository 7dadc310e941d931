"""Every error a user can cause, one tree under `MracDesignError`.

Each message says what is wrong, with the numbers, and what to do about it. The command
line prints the message alone and exits with status 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


class MracDesignError(Exception):
    """Root of every error this package raises on purpose."""


class ParameterError(MracDesignError):
    """A number given by the user is outside its meaningful range."""

    def __init__(self, name: str, value: object, requirement: str) -> None:
        self.name = name
        self.value = value
        self.requirement = requirement
        super().__init__(f"{name} = {value}: {requirement}")


class FileError(MracDesignError):
    """A file the user named cannot be used; the message names the place inside it."""

    def __init__(self, path: Path | str, place: str, problem: str) -> None:
        self.path = Path(path)
        self.place = place
        self.problem = problem
        where = f"{path}: {place}" if place else f"{path}"
        super().__init__(f"{where}: {problem}")


class ModelFileError(FileError):
    """A robot file breaks its schema or describes a body that cannot exist."""


class ScenarioFileError(FileError):
    """A scenario file breaks its schema."""


class MotionFileError(FileError):
    """A heart-motion file cannot be read as a motion."""


class DegreeConditionError(MracDesignError):
    """A polynomial design has no causal solution with the given degrees."""

    def __init__(self, condition: str, *, required: int, given: int) -> None:
        self.condition = condition
        self.required = required
        self.given = given
        super().__init__(f"{condition}: needs at least degree {required}, got {given}")


class NotCoprimeError(MracDesignError):
    """A and B of a Diophantine equation share roots that are not in the target."""

    def __init__(self, common_roots: Sequence[complex]) -> None:
        self.common_roots = tuple(common_roots)
        roots = ", ".join(f"{root:.6g}" for root in self.common_roots)
        super().__init__(
            f"A and B share the roots {roots}, which the target polynomial lacks: no R, S can "
            "move them; cancel the common factor in the plant model first"
        )


class SingularPostureError(MracDesignError):
    """The task Jacobian cannot be inverted well enough at a posture."""

    def __init__(self, condition_number: float, limit: float, posture: Sequence[float]) -> None:
        self.condition_number = condition_number
        self.limit = limit
        self.posture = tuple(float(value) for value in posture)
        angles = ", ".join(f"{value:.4g}" for value in self.posture)
        super().__init__(
            f"the task Jacobian at q = ({angles}) has condition number {condition_number:.3g} "
            f"(limit {limit:.3g}): exact linearisation is impossible near a singular posture; "
            "start elsewhere"
        )


class CompilationError(MracDesignError):
    """The C compiler refused the generated code."""

    def __init__(self, command: Sequence[str], stderr: str) -> None:
        self.command = tuple(command)
        self.stderr = stderr
        first = next((line for line in stderr.splitlines() if line.strip()), "no message")
        super().__init__(f"'{' '.join(command)}' failed: {first}")


class SimulationError(MracDesignError):
    """A simulation left the range of finite numbers."""


class Cancelled(MracDesignError):
    """The user interrupted a long run."""
