"""`python -m mrac_design.verify certificate.json`: exit status 0 only for an accepted file."""

from __future__ import annotations

import sys
from pathlib import Path

from mrac_design.verify.checker import verify_certificate


def main(arguments: list[str]) -> int:
    """Check one file and write what was found; 0 accepted, 1 refused, 2 not readable."""
    if len(arguments) != 1:
        sys.stderr.write("usage: python -m mrac_design.verify certificate.json\n")
        return 2
    path = Path(arguments[0])
    try:
        report = verify_certificate(path)
    except OSError as error:
        sys.stderr.write(f"{path}: {error.strerror}\n")
        return 2
    for finding in report.findings:
        sys.stderr.write(f"{path}:{finding.line}: {finding.pointer}: {finding.problem}\n")
    for statement in report.statements:
        sys.stdout.write(statement + "\n")
    sys.stdout.write("accepted\n" if report.accepted else "refused\n")
    return 0 if report.accepted else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
