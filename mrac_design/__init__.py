"""Design, certify, simulate and deploy model reference adaptive force control.

robot, motion → plant → design → stability → controller → simulation → metrics → study → export,
report, workbench. Import from the subpackages; `mrac_design.study.run_study` runs the whole line.
"""

import time as _time

LOADED_AT = _time.time_ns()
"""When this process began to load the package, ns since the epoch."""
