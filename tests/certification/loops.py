"""Closed loops that certificates are made of in these tests."""

from dataclasses import replace
from functools import cache

import numpy as np

from starhold.algebra.quaternion import NO_TURN
from starhold.algebra.vector import ZERO
from starhold.certification.certify import Wanted, certify
from starhold.conformance.bench import sample_loop
from starhold.laws import lqr, matrix_pd
from starhold.laws.catalogue import catalogue
from starhold.parts.bodies.rigid_body import State
from starhold.parts.contract import Noise
from starhold.parts.craft import bare_inertia, make_craft, tensor
from starhold.parts.effectors.layouts import pyramid
from starhold.parts.effectors.wheels import axial_inertia, make_wheels
from tests import making
from tests.making import ORBITAL, aimed

FULL = make_craft([[2.0, 0.1, -0.2], [0.1, 3.0, 0.15], [-0.2, 0.15, 4.0]], torque_limit=0.05)
PRINCIPAL = make_craft([2.0, 3.0, 4.0], torque_limit=0.05)
UNEVEN = lqr.FormII((1.0, 1.0, 1.0, 1.0, 2.0, 3.0), (1e3, 1e3, 1e3))
LOPSIDED = lqr.FormII((1e-4, 1e-4, 1e-4, 1.0, 4e4, 1.0), (1e3, 1e3, 1e3))
"""Weights far from (2.24): of stiffnesses 1 to 200 no function in use here proves convergence from every rate."""


def loop_of(law, gains, craft=FULL, **changes):
    """A law in orbit under the gravity gradient, at an inertial target, feeding back q as it is."""
    target = changes.pop("target", aimed(NO_TURN))
    target = aimed(target, changes.pop("knots", ())) if isinstance(target, np.ndarray) else target
    given = {"sign_policy": "as_published", **changes}
    loop = sample_loop(catalogue()[law], gains).without("target")
    return replace(loop.with_parts(target), craft=craft, **given)


def free(loop):
    """The loop without torque from outside."""
    still = loop.start._replace(position=ZERO, velocity=ZERO)
    return replace(loop.without("environment"), start=still)


@cache
def textbook():
    """A loop of every law that can be certified, under the assumptions of its textbook: name to loop."""
    formed = {
        "lqr-I": (lqr.FormI(0.01, 0.01, 1.0), FULL),
        "lqr-I-gyroscopic-left": (lqr.FormI(0.01, 0.01, 0.0), FULL),
        "lqr-II": (lqr.FormII(UNEVEN.q, UNEVEN.r, 1), PRINCIPAL),
        "lqr-II-uneven": (UNEVEN, PRINCIPAL),
        "lqr-III": (lqr.FormIII(UNEVEN.q, UNEVEN.r, 1), FULL),
        "lqr-numeric": (lqr.Numeric(np.diag(UNEVEN.q).tolist(), np.diag(UNEVEN.r).tolist()), FULL),
        "matrix-pd-inertial": (matrix_pd.Inertial(10.0, 50.0, 0.05), FULL),
        "matrix-pd-diagonal": (matrix_pd.Diagonal(10.0, 50.0, (0.05, 0.06, 0.07)), PRINCIPAL),
    }
    found = {}
    for name, (spec, craft) in formed.items():
        law = catalogue()[next(known for known in ("matrix-pd", "lqr") if name.startswith(known))]
        found[name] = loop_of(law.name, law.design(craft, spec), craft)
    for name in ("pd", "lyapunov", "sliding", "wheel"):
        for number, gains in enumerate(catalogue()[name].examples()):
            found[f"{name}-{number}"] = loop_of(name, gains)
    return found


@cache
def certified(name, sign_policy="as_published", disturbance=0.0):
    """The certificate of a loop of these, made once for all tests of a worker."""
    loop = textbook()[name]
    loop = loop_of(loop.law.name, loop.gains, loop.craft, sign_policy=sign_policy)
    return certify(loop, name, Wanted(disturbance=disturbance))


def energy(P, s):
    """V = w.Pw/2 + s (1 - q0) of states, without cancellation near the target."""

    def height(states):
        q, w = states[:4], states[4:7]
        return 0.5 * np.einsum("ik,ij,jk->k", w, P, w) + 0.5 * s * ((1.0 - q[0]) ** 2 + np.sum(q[1:] ** 2, axis=0))

    return height


def rotors(law, gains, target=None, layout=pyramid, **changes):
    """A law on reaction wheels that hold some momentum at the start; in orbit, under the gravity gradient, if the target is
    there."""
    axes = layout()
    wheels = make_wheels(axes, 1e-3, changes.pop("torque_limit", 0.05), changes.pop("momentum_limit", 1.0))
    body = bare_inertia(tensor(FULL.inertia), axial_inertia(wheels))
    loop = loop_of(law, gains, make_craft(body), target=target or aimed(NO_TURN), limit="none", **changes)
    loop = loop.with_parts(making.rotors(wheels, [0.01 * (-1.0) ** i for i in range(len(axes))]))
    return loop if target == ORBITAL else free(loop)


def is_pointing(claim):
    """Whether it is a claim that takes in what parts say."""
    return (claim.kind, claim.outcome) == ("pointing", "proved")


def says(fitted):
    """Whether a part tells a bound of its torque or acceleration, or finite ones of its errors and no noise; or shows what
    is not read."""
    if fitted.part.role == "sensor" and not {*fitted.part.module.Reading._fields} & {*State._fields}:
        return True
    bound, error, noise = (fitted.part.hook(name) for name in ("bound", "error", "noise"))
    quiet = noise is None or noise(fitted.params, 0.1) == Noise()
    return (
        bound is not None
        or fitted.part.hook("perturbation") is not None
        or (quiet and error is not None and np.isfinite(error(fitted.params)).all())
    )
