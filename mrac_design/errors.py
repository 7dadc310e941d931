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


class GainFileError(FileError):
    """A gains file breaks its schema, or its numbers are not those that were written."""


class DegreeConditionError(MracDesignError):
    """A polynomial design has no causal solution with the given degrees."""

    def __init__(self, condition: str, *, required: int, given: int) -> None:
        self.condition = condition
        self.required = required
        self.given = given
        super().__init__(f"{condition}: needs at least degree {required}, got {given}")


class NotCoprimeError(MracDesignError):
    """A and B of a Diophantine equation share roots, to the precision of the arithmetic."""

    def __init__(self, common_roots: Sequence[complex]) -> None:
        self.common_roots = tuple(common_roots)
        roots = ", ".join(_root(root) for root in self.common_roots)
        super().__init__(
            f"A and B share the roots {roots}: no R, S can move them; cancel the common factor "
            "in the plant model, or remove the prescribed factor of R or S that meets the plant"
        )


class IllConditionedError(MracDesignError):
    """Floating arithmetic cannot solve a Diophantine equation well enough."""

    def __init__(
        self, *, residual: float, limit: float, cancellation: float, coprimeness: float
    ) -> None:
        self.residual = residual
        self.limit = limit
        self.cancellation = cancellation
        self.coprimeness = coprimeness
        super().__init__(
            f"the residual of A R + B S = Ac is {residual:.2g} of Ac, more than {limit:.2g}: A R "
            f"and B S are up to {cancellation:.2g} times Ac and cancel, so rounding R and S to "
            f"float64 already costs {cancellation * 1.1e-16:.2g} (the smallest singular value of "
            f"A and B is {coprimeness:.2g}, 0 means a common root); move the wanted poles nearer "
            "to the plant's, allow a larger residual, or design over the rationals"
        )


class NotCausalError(MracDesignError):
    """A process or controller would have to know the future."""

    def __init__(self, problem: str, remedy: str) -> None:
        self.problem = problem
        self.remedy = remedy
        super().__init__(f"not causal: {problem}; {remedy}")


class CancellationError(MracDesignError):
    """A zero of the process may not be cancelled."""

    def __init__(self, zeros: Sequence[complex], reason: str) -> None:
        self.zeros = tuple(zeros)
        self.reason = reason
        listed = ", ".join(_root(zero) for zero in self.zeros)
        super().__init__(
            f"the process zeros {listed} cannot be cancelled: {reason}; keep them in B⁻"
        )


class ModelFollowingError(MracDesignError):
    """The wanted model lacks zeros that the controller has to keep."""

    def __init__(self, zeros: Sequence[complex]) -> None:
        self.zeros = tuple(zeros)
        listed = ", ".join(_root(zero) for zero in self.zeros)
        super().__init__(
            f"the process zeros {listed} are not cancelled, so the closed loop keeps them: give "
            "Bm these zeros too, or ask for unit static gain only"
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
        lines = [line.strip() for line in stderr.splitlines() if line.strip()]
        first = next((line for line in lines if "error" in line), (lines or ["no message"])[0])
        super().__init__(f"'{' '.join(command)}' failed: {first}")


class SimulationError(MracDesignError):
    """A simulation left the range of finite numbers."""


class RealtimeError(MracDesignError):
    """The real-time runner cannot be built or run on this machine."""


class EnsembleError(MracDesignError):
    """An ensemble cannot start, go on from its store, or reach its cluster."""


class TuningError(MracDesignError):
    """No choice of the free variables meets the constraints."""


class CertificateError(MracDesignError):
    """A stability certificate does not exist, or does not hold what it claims."""

    def __init__(self, problem: str) -> None:
        self.problem = problem
        super().__init__(f"no certificate: {problem}")


class NotebookError(FileError):
    """A notebook of the report cannot be read, or one of its cells failed."""


class RenderingError(MracDesignError):
    """The executed notebooks cannot be turned into HTML or PDF."""

    def __init__(self, output: str, problem: str) -> None:
        self.output = output
        self.problem = problem
        super().__init__(f"{output} could not be made: {problem}")


def _root(root: complex) -> str:
    return f"{root.real:.6g}" if root.imag == 0 else f"{root:.6g}"
