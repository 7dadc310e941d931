"""Random pole placements: degree 1 to 8, roots over three decades."""

from __future__ import annotations

import numpy as np

from mrac_design.design import KeepZeros, PolePlacement, UnitStaticGain
from mrac_design.plant import Process
from mrac_design.polynomials import exact_polynomial
from mrac_design.time_domain import Continuous

DECADES = (-1.5, 1.5)


def random_roots(rng, count, *, stable):
    found = []
    while len(found) < count:
        modulus = 10.0 ** rng.uniform(*DECADES)
        side = -1.0 if stable or rng.random() < 0.7 else 1.0
        if count - len(found) >= 2 and rng.random() < 0.5:
            damping = rng.uniform(0.1, 1.0)
            root = modulus * complex(side * damping, np.sqrt(1.0 - damping**2))
            found += [root, root.conjugate()]
        else:
            found.append(side * modulus)
    return found


def polynomial(roots):
    return exact_polynomial(np.atleast_1d(np.real(np.poly(roots))).tolist())


def random_process(rng, degree, common=()):
    """Process of the given degree, its numerator of any lower one, with `common` roots in both."""
    least = len(common)
    zeros = rng.integers(least, max(degree, least + 1))
    A = polynomial([*common, *random_roots(rng, degree - least, stable=False)])
    B = polynomial([*common, *random_roots(rng, zeros - least, stable=False)])
    gain = exact_polynomial([10.0 ** rng.uniform(-2, 2)])
    return Process(A=A, B=B * gain, domain=Continuous())


def random_placement(rng, process, observer_degree):
    return PolePlacement(
        process=process,
        Am=polynomial(random_roots(rng, process.A.degree(), stable=True)),
        Ao=polynomial(random_roots(rng, observer_degree, stable=True)),
        zeros=KeepZeros(),
        tracking=UnitStaticGain(),
    )
