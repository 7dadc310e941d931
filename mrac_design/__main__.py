"""`mrac`, and `python -m mrac_design`."""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command line; `verify` alone, which must work where only python-flint is."""
    if sys.argv[1:2] == ["verify"] and "--help" not in sys.argv:
        from mrac_design.verify.__main__ import main as verify

        sys.exit(verify(sys.argv[2:]))
    from mrac_design.cli.app import main as command_line

    command_line()


if __name__ == "__main__":
    main()
