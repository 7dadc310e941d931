"""The Python in the README runs."""

from __future__ import annotations

import re
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"


def test_the_ten_lines_run(capsys):
    code = re.search(r"```python\n(.*?)```", README.read_text("utf-8"), re.DOTALL)
    assert code is not None
    exec(compile(code.group(1), str(README), "exec"), {})
    printed = capsys.readouterr().out
    assert "adaptive_inverse" in printed
    assert printed.count("%") == 9
