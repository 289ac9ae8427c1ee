"""False claims about a torque that is late, of which all is shown but one thing, and flights about one axis against them."""

from dataclasses import replace
from fractions import Fraction
from math import cos, radians, sin

import numpy as np
import pytest

import starhold as sh
from starhold.certification.evidence.attitude import Loop
from starhold.certification.evidence.ellipsoids import MORE, ends
from starhold.certification.evidence.finding import obligations
from starhold.certification.evidence.lates import numbers_of
from starhold.certification.evidence.pointing import Pushed
from starhold.certification.subject import make_subject
from starhold.certification.unmodelled import Pushes
from starhold.kernel.theorems.pointing import on_level
from starhold.parts.contract import Late
from tests.kernel.certificates import failing
from tests.kernel.lagging import flying
from tests.kernel.oracle import Oracle, number
from tests.making import built

MOMENT, K_RATE, K_ATTITUDE, PERIOD, ERROR = 2.0, 0.09, 0.009, 0.1, 1e-6
KEPT, MEAN, PIECES = 0.9, 0.95, 4
"""What is late, as shares, and in how many pieces of a period it acts here."""
SLOW = Fraction(1, 10**6)
"""How fast a torque follows (N m/s)."""


def without_rest():
    """The claim about a torque that is late in any direction, as if what errors of the command add to that were none."""
    law = {"type": "lyapunov", "k_rate": K_RATE, "k_attitude": K_ATTITUDE}
    kept = {"simulation": {"duration": "1 min", "control_period": PERIOD}, "name": "late", "law": [law]}
    loop = Loop(make_subject(built(sh.scenario({"spacecraft": {"inertia": [MOMENT] * 3}} | kept))))
    pushed = Pushed(loop, Pushes(1e-8, command=ERROR))
    pushed.numbers |= numbers_of(Late(KEPT, MEAN))
    chain = pushed.chain(pushed.usual[0], radians(20.0), 0.0)
    motion = chain.motion
    enough = motion.late.rest
    motion.late = replace(motion.late, rest=Fraction(0))
    chain.descend()
    tube, _ = on_level(motion, Fraction(chain.levels[-1]["end"]))
    angle, rate = ends(motion, tube, tube.region.X)
    swing = motion.swing(motion.tube(motion.region(Fraction(chain.level))))
    numbers = pushed.beginning(radians(20.0), 0.0, {}) | chain.of_level()
    numbers |= {"highest": (chain.level + PERIOD / 2 * float(swing)) * MORE, "end.angle": angle, "end.rate": rate}
    numbers |= {"settling": PERIOD * chain.samples * MORE}
    claim = pushed.claim(chain.V, numbers, levels=chain.levels, ellipsoids=[])
    _, known = obligations(claim, loop.by_digest)
    used = {name: x for name, x in claim["subject"].items() if name not in known.subject.unread}
    return claim | {"subject": used}, loop.by_digest, enough


def test_errors_of_the_command_add_up_in_a_torque_that_is_late():
    claim, programs, enough = without_rest()
    assert failing(claim, programs) == {"late torque"}
    n = {name: number(x) for name, x in claim["numbers"].items()}
    angle = rate = late = last = 0.0
    for k in range(int(1.2 * n["settling"] / PERIOD)):
        command = -K_RATE * rate - K_ATTITUDE * sin(angle / 2) + ERROR * (-1) ** k
        # What it changes by is late in one direction.
        late, last = KEPT * late + abs(command - last) * (k > 0), command
        for piece in range(PIECES):
            step, a = PERIOD / PIECES, (command + late * KEPT ** ((piece + 1) / PIECES)) / MOMENT
            angle, rate = angle + step * rate + step * step / 2 * a, rate + step * a
    assert late < float(enough)
    assert angle > 2 * n["end.angle"]
    # With what is late the same levels are not reached.
    told = claim | {"numbers": claim["numbers"] | {"late.torque.rest": str(enough)}}
    assert "late torque" not in failing(told, programs)
    assert failing(told, programs)


@pytest.mark.slow
def test_a_torque_that_follows_too_slowly_leaves_the_set():
    loop, claim, _ = flying("rate-limit", 0.1)
    one, programs = claim.proof.claim, dict(claim.proof.programs)
    assert failing(one, programs) == set()
    told = one | {"numbers": one["numbers"] | {"late.torque.most": str(SLOW * Fraction(loop.period))}}
    assert failing(told, programs) == {"torque that follows"}
    oracle, (k_rate, k_attitude), h = Oracle({"programs": programs}, told), loop.gains[:2], loop.period
    angle, rate = oracle.numbers["angle"], 0.0
    torque = first = -k_attitude * sin(angle / 2)

    def energy():
        return oracle.lyapunov(np.array([cos(angle / 2), sin(angle / 2), 0.0, 0.0]), np.array([rate, 0.0, 0.0]))

    assert energy() <= oracle.numbers["level"]
    for _ in range(int(60.0 / h)):
        off = -k_rate * rate - k_attitude * sin(angle / 2) - torque
        torque += min(max(off, -float(SLOW) * h), float(SLOW) * h)
        angle, rate = angle + h * rate + h * h / 2 * torque / oracle.J[0, 0], rate + h * torque / oracle.J[0, 0]
    assert abs(first) < oracle.numbers["late.torque.begun"]
    assert energy() > 2 * oracle.numbers["highest"]
