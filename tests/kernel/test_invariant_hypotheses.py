"""False claims about invariant sets of which all is shown but one thing: that thing is not idle."""

import math
from dataclasses import dataclass

import pytest

from starhold.algebra.scalar import absolute, less, where
from tests.kernel.sets import ORIGIN, SQUARE, attempt, cycle, round_, slanted, value

UNIT = {"x": (-1, 1), "y": (-1, 1)}
AT_ORIGIN = {"member.x": 0, "member.y": 0}
POINT = {"shape of V": [1, 1], "powers of V": [1, 1]}
SET = {"powers of V": 1}
STEP, LONG = 1e-3, 20.0


@dataclass
class Case:
    """A claim with hints, and a state from which a motion contradicts it."""

    theorem: str
    rates: object
    functions: dict
    box: dict
    numbers: dict
    hints: dict
    state: tuple

    def attempt(self):
        tried = attempt(self.theorem, self.rates, self.functions, self.box, self.numbers)
        tried.hints = self.hints
        return tried


def inward(*radii):
    """r' = -r (r^2 - a) (r^2 - b) ... for the squares of these radii, or -r."""

    def rates(x, y):
        speed = -1 + 0 * x
        for a in radii:
            speed = speed * (round_(x, y) - a)
        return x * speed, y * speed

    return rates


def spiral(x, y):
    """Turns, and comes slowly to the origin."""
    return 2 * y - x / 100, -x / 2 - y / 100


def turning(x, y):
    return y - x / 100, -x - y / 100


def pushed(x, y):
    """Comes quickly to y = 0 from both sides, along which it leaves."""
    return where(less(x, 0.0), -1.0, 1.0), where(less(y, 0.0), 3.0, -3.0)


def torn(x, y):
    return where(less(0.0, x), round_(x, y), 2 * round_(x, y))


def split(x, y):
    """Leaves where x > 0."""
    return where(less(0.0, x), x, -x), -y


def halves(x, y):
    return where(less(0.0, x), round_(x, y), round_(x, y) + x * x)


def avoiding(rate, V):
    """From the unit disc to y >= 2."""
    return Case(
        "avoids",
        lambda x, y: (0 * x, rate(y)),
        {"start": lambda x, y: 1 - round_(x, y), "unsafe": lambda x, y: y - 2, "V": lambda x, y: V(y)},
        {},
        {"start.x": 0, "start.y": 0, "unsafe.x": 0, "unsafe.y": 2},
        {},
        (0.0, 0.9),
    )


CASES = {
    "positive": Case("attracts", inward(0.25), {"V": lambda x, y: round_(x, y) * cycle(x, y)}, SQUARE, ORIGIN | {"level": 1},
                     POINT, (0.1, 0.1)),
    "border": Case("attracts", spiral, {"V": lambda x, y: x * x + 4 * y * y}, UNIT, ORIGIN | {"level": 2}, POINT,
                   (0.0, 0.7)),
    "changes": Case("attracts", lambda x, y: (y, -x + y / 10), {"V": round_}, SQUARE, ORIGIN | {"level": 1}, POINT,
                    (0.5, 0.0)),
    "escapes": Case("attracts", lambda x, y: (y, -x), {"V": round_}, SQUARE, ORIGIN | {"level": 1},
                    POINT | {"weakly of V": [[0, 0]], "escape of V": {"x y": "1"}}, (0.5, 0.0)),
    "continuous": Case("attracts", turning, {"V": torn}, SQUARE, AT_ORIGIN | {"level": 3}, SET, (1.7, 0.0)),
    "apart": Case("attracts", turning, {"V": torn}, SQUARE, AT_ORIGIN | {"level": 3}, SET | {"apart": [[0, 1]]}, (1.7, 0.0)),
    "agree": Case("attracts", pushed, {"V": lambda x, y: absolute(x) + absolute(y)}, UNIT, AT_ORIGIN | {"level": 1}, SET,
                  (0.3, 0.3)),
    "never": Case("attracts", split, {"V": halves}, SQUARE, AT_ORIGIN | {"level": 3}, SET | {"never of V": [1]}, (1.0, 0.0)),
    "start": Case("attracts", lambda x, y: (y, -x - y), {"start": lambda x, y: 2 - round_(x, y), "V": slanted}, SQUARE,
                  ORIGIN | {"level": 2}, POINT, (0.99, 0.99)),
    "inside": Case("attracts", inward(0.5, 1.0), {"V": cycle, "core": round_}, SQUARE,
                   ORIGIN | {"member.x": 1, "member.y": 0, "level": 2, "core.level": "2/5"},
                   SET | {"shape of core": [1, 1], "powers of core": [1, 1]},
                   (0.9, 0.0)),
    "changes of what is stable": Case("is stable", lambda x, y: (y, -x + y / 10), {"V": round_}, SQUARE,
                                      ORIGIN | {"level": 1}, {"shape of V": [1, 1]}, (0.5, 0.0)),
    "border of what is unstable": Case("is unstable", inward(), {"V": lambda x, y: round_(x, y) - 9}, SQUARE, AT_ORIGIN, SET,
                                       (0.5, 0.1)),
    "changes of what is unstable": Case("is unstable", inward(), {"V": round_}, SQUARE,
                                        ORIGIN | {"direction.x": 1, "direction.y": 0}, {"powers of V": [1, 1]}, (0.5, 0.0)),
    "start of what avoids": avoiding(lambda y: y - 0.5, lambda y: y - 0.5),
    "unsafe of what avoids": avoiding(lambda y: 3 - y, lambda y: y - 3),
    "barrier of what avoids": avoiding(lambda y: 1 + 0 * y, lambda y: y - 1.5),
}  # fmt: skip


def lacking(tried):
    """The names, without places, of what has no evidence."""
    names = tried.missing(every=True)[0]
    return {"escapes" if name.endswith("escapes") else name.split()[0] for name in names}


def contradicted(case):
    """Tell whether the motion from the state, by small steps, is against the claim."""
    programs, at = case.attempt().programs, {"x": case.state[0], "y": case.state[1]}
    level = float(case.numbers.get("level", math.inf))
    begins = value(programs["V"], at)[0]
    assert "start" in programs or begins < level
    # A claim that there are motions that leave is contradicted where none does.

    def boxed():
        return all(low <= at[x] <= high for x, (low, high) in case.box.items())

    if "start" in programs:
        assert value(programs["start"], at)[0] >= 0.0
        if case.theorem == "attracts" and begins >= level:
            return True
    for _ in range(int(LONG / STEP)):
        rates = value(programs["rates"], at)
        at = {x: at[x] + STEP * rate for x, rate in zip(at, rates, strict=True)}
        height = value(programs["V"], at)[0]
        if case.theorem == "avoids" and value(programs["unsafe"], at)[0] >= 0.0:
            return True
        if case.theorem == "attracts" and (height > level + 1e-3 or not boxed()):
            return True
        if case.theorem == "is stable" and height > begins + 0.1:
            return True
        if case.theorem == "is unstable" and not boxed():
            return False
    return case.theorem == "is unstable" or (case.theorem == "attracts" and math.hypot(*at.values()) > 0.05)


@pytest.mark.parametrize("hypothesis", CASES)
def test_only_this_hypothesis_fails_and_the_claim_is_false(hypothesis):
    case = CASES[hypothesis]
    assert lacking(case.attempt()) == {hypothesis.split(" of ")[0]}
    assert contradicted(case)
