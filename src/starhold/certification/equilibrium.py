"""Claims about equilibria beside a libration point under `l2-equilibrium`, read off the law's and the model's own equations.

Each axis moves on its own: x'' = (p - k) x - c x' with p = Omega^2 + 2 C, y'' = -(C - Omega^2)(y - y0) - ..., z likewise.

With the control along X limited to U and the others held at rest, which takes control too, sigma = x + x'/s with s = sqrt(p)
obeys sigma' = s sigma + u/s and x' = s (sigma - x). From |sigma| >= U/p nothing returns, for there s |sigma| >= U/s. On
|sigma| <= m < U/p, where u = -clip(c s sigma + e x) with e = k - s c, a number that rounding leaves,

    sigma u <= -f sigma^2 + |e| |sigma| |x|,   f = min(U/m, c s) > p,

so that no motion leaves {|sigma| <= m, |x| <= X}, and with a mu > 0 that makes a form definite (sigma^2 + mu x^2)/2 falls.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flint import arb

from starhold.algebra.polynomial import Polynomial, constants, exact
from starhold.algebra.vector import add
from starhold.certification.certificate import BALLS, EXACT, EXACT_SIGN, Claim
from starhold.certification.convergence import Obligations
from starhold.certification.matrices import number
from starhold.certification.station_terms import UNLIMITED, assumed, mismatch, model_of, point_measurement
from starhold.certification.subject import above, below
from starhold.laws import l2_equilibrium as law
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.bodies.libration_point import linear

HELD = "held at rest along Y and Z, where no Coriolis acceleration acts along X"
CLEAR = "never at the centre of one of the two bodies"
SHARE = 0.999
"""The part that is certified of the bound beyond which no motion returns."""
FAR = 1e3
"""|x| up to which it is, as a multiple of the bound."""


class Axis(NamedTuple):
    """The X axis as balls: p and its root s, the gains k and c, the limit U."""

    p: Any
    s: Any
    k: Any
    c: Any
    limit: Any


def returns(loop: ClosedLoop) -> Claim:
    """The claim that every motion ends at the equilibrium that the law makes."""
    found = Obligations()

    def finish() -> Claim:
        clear = () if model_of(loop) == "linear" else (CLEAR,)
        return Claim("equilibrium", {}, {}, assumed(loop, UNLIMITED, *clear), tuple(found))

    reason = mismatch(loop)
    if reason or not _separate(loop):
        found.add("form", EXACT, None, {"reason": reason or "the axes do not move each on its own"})
        return finish()
    found.add("form", EXACT, True)
    plant, gains = (exact(loop.craft.rate), exact(loop.craft.stiffness)), loop.gains
    stiff = exact(gains.k_x) > plant[0] ** 2 + 2 * plant[1] and plant[1] > plant[0] ** 2
    damped = all(exact(k) > 0 for k in gains.k_velocity)
    found.add("each axis returns", EXACT_SIGN, stiff and damped)
    return finish()


def saturated_axis(loop: ClosedLoop) -> Claim:
    """From where the X axis returns although its control is limited, and that it does from nowhere else."""
    found, told, witness = Obligations(), dict[str, Any](), dict[str, Any]()
    axis = _axis(loop)
    if _demand(loop) > exact(loop.saturation_limit()):
        found.add("stays", BALLS, None, {"reason": "the other axes cannot be held with so little control"})
        return Claim("saturated-axis", {"limit": loop.saturation_limit()}, {}, assumed(loop, HELD), tuple(found))
    bound = axis.limit / axis.p
    width = below(exact(number(bound)) * exact(SHARE))
    far = below(exact(number(bound)) * exact(FAR))
    told |= {
        "limit": loop.saturation_limit(),
        "width": width,
        "reach": far,
        "boundary": above(exact(number(bound)) * exact(1 + 1e-15)),
    }
    m, e = arb(width), abs(axis.k - axis.s * axis.c)
    holds = (axis.limit / m).min(axis.c * axis.s)
    mu = number(exact(number(2 * (holds - axis.p) / axis.p)))
    witness["mu"] = mu
    stays = axis.limit > axis.p * m and axis.c * axis.s * m - e * far > axis.p * m and m < far
    found.add("stays", BALLS, True if stays else None, {} if stays else {"reason": "the feedback is too weak"})
    form = (holds - axis.p) * arb(mu) > ((e / axis.s + arb(mu) * axis.s) / 2) ** 2
    falls = bool(holds > axis.p and mu > 0.0 and form)
    found.add("strict", BALLS, falls or None, {} if falls else {"reason": "no function of the form is shown to fall"})
    found.add("nothing returns from beyond", BALLS, bool(arb(told["boundary"]) * axis.p >= axis.limit))
    return Claim("saturated-axis", told, witness, assumed(loop, HELD), tuple(found))


def _axis(loop: ClosedLoop) -> Axis:
    p = exact(loop.craft.rate) ** 2 + 2 * exact(loop.craft.stiffness)
    k, c = exact(loop.gains.k_x), exact(loop.gains.k_velocity[0])
    return Axis(arb(p), arb(p).sqrt(), arb(k), arb(c), arb(loop.saturation_limit()))


def _demand(loop: ClosedLoop) -> Any:
    """The control that holding Y and Z takes at least."""
    square, c = exact(loop.craft.rate) ** 2, exact(loop.craft.stiffness)
    return max(abs((c - square) * exact(loop.gains.y)), abs(c * exact(loop.gains.z)))


def _separate(loop: ClosedLoop) -> bool:
    """Whether under the law every axis of the linear model has the acceleration that the claims are about."""
    measurement: Any = point_measurement()
    plant, gains = constants(loop.craft), constants(loop.gains)
    found: Any = add(linear(measurement.position, measurement.velocity, plant), law.feedback(measurement, gains, plant))
    x, v = measurement.position, measurement.velocity
    square, c = plant.rate * plant.rate, plant.stiffness
    k = gains.k_velocity
    wanted = (
        (square + 2 * c - gains.k_x) * x[0] - k[0] * v[0],
        (square - c) * (x[1] - gains.y) - k[1] * v[1],
        -1 * c * (x[2] - gains.z) - k[2] * v[2],
    )
    return not any(Polynomial((a - b).terms).terms for a, b in zip(found, wanted, strict=True))
