"""Claims about regions of the law `modal`, written without the certifier."""

import math

import numpy as np

from starhold.checker.modal import ModalRegion
from starhold.checker.subject import read_subject
from tests.certification.by_hand import TEXTBOOK, by_hand, proved_by_hand

PLAIN, BETTER = (4.0, 0.0, 0.0, 0.0), (5.0, -0.2, 2.0, 0.9)
A, B = -0.428, -0.01


def highest_turn(level, witness):
    """The largest turn of a witness that is in {V <= level a2}, where V grows with it."""
    p, c2 = witness[:2]
    u = level / p if c2 == 0.0 else (math.sqrt(max(p * p + 4.0 * c2 * level, 0.0)) - p) / (2.0 * c2)
    return 2.0 * math.acos(1.0 - min(max(u, 0.0), 2.0))


def region(c, witness=PLAIN, sign_policy="as_published", a=A, assumptions=TEXTBOOK, **changes):
    """A claim with level = c a2, and turn and rate as large as these can be up to rounding."""
    names = [("form", "exact identity"), ("descent", "ball arithmetic")]
    if witness[2] == witness[3] == 0.0:
        names.append(("only equilibrium", "LaSalle"))
    names.append(("jumps lower V" if sign_policy == "hysteresis" else "single equilibrium in the set", "exact inequality"))
    level = c * a * a
    numbers = {"level": level, "slew_angle": 0.999999 * highest_turn(c, witness), "rate": 0.999999 * math.sqrt(2.0 * level)}
    return proved_by_hand(
        "region", names, numbers | changes, dict(zip(("p", "c2", "g", "m"), witness, strict=True)), assumptions
    )


def file(claim, a=A, b=B, **changes):
    return by_hand("modal", {"phi_0": a, "phi_1": a, "b": b}, [claim], **changes)


def read(content):
    given = content["certificates"][0]
    return ModalRegion(read_subject(given["subject"]), given["claims"][0]["numbers"], given["claims"][0]["witness"])


def by_formula(a, b, witness, u, w, x):
    """V/alpha2 and V'/alpha3 at u = 1 - q0, |w|/alpha and the cosine between w and q."""
    p, c2, g, m = witness
    beta, q0, long, G = a * b, 1.0 - u, np.sqrt(u * (2.0 - u)), g + m * u
    K = 2.0 * (1.0 - 2.0 * beta) * u + (1.0 - 8.0 * beta) / 2.0 * w * long * x - beta * q0 * w * w
    f1 = -2.0 + K * (1.0 + long * long * x * x) / (1.0 + long * long) + G * q0 / 2.0 + m * long * long * x * x / 2.0
    f2 = -2.0 + (p + 2.0 * c2 * u) / 2.0 + G * (K - 2.0)
    return w * w / 2.0 + p * u + c2 * u * u + G * w * long * x, w * w * f1 + w * long * x * f2 - 2.0 * G * long * long
