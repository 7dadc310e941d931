"""An independent checker of stability certificates.

It needs Python and python-flint only, and shares no code with the designer, the solver or the
certificate's maker: it rebuilds the loop's matrices from the equations and decides every matrix
inequality over the rationals.

    python -m mrac_design.verify certificate.json
"""

from mrac_design.verify.checker import Finding, Report, verify_certificate

__all__ = ["Finding", "Report", "verify_certificate"]
