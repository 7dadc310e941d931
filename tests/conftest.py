"""Properties are tried on the same examples in every run; `--hypothesis-profile explore` draws
new ones, which is how to hunt for counterexamples."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("explore", print_blob=True)
settings.register_profile("same-examples", derandomize=True, database=None)
settings.load_profile("same-examples")
