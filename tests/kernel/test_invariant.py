"""Invariant sets in the kernel: what is proved, what is refused, and what mutations of stored certificates may say."""

import copy
import json
import math
import random
from fractions import Fraction

import pytest

from starhold.algebra.scalar import less, where
from starhold.kernel.check import check
from starhold.kernel.numbers import WORK, Account, RefusedError, rational
from starhold.kernel.programs import digest
from tests.kernel.sets import ORIGIN, SETS, SQUARE, attempt, certificate, round_, slanted, text, value
from tests.tiers import leading

LEVELS = {
    "van der Pol": 2.304,
    "cycle": 0.999,
    "spin": 3.12,
    "strip": 0.999,
    "damped": 3.99,
    "sliding": 0.999,
    "pendulum": 1.99,
}
STEP = 1e-5


def claimed(content):
    (claim,) = content["claims"]
    return claim


@pytest.mark.parametrize("name", leading(sorted(SETS, key=lambda name: name == "strip"), len(SETS) - 1))
def test_what_is_claimed_is_proved_up_to_the_level(name):
    (proved,) = check(text(name))
    assert WORK - Account.left < WORK / 10
    numbers = claimed(json.loads(text(name)))["numbers"]
    assert float(Fraction(numbers.get("level", "0"))) >= LEVELS.get(name, 0.0)
    assert ("filippov" in proved.statement.assumptions) == (name == "sliding")
    assert not false(json.loads(text(name)), random.Random(1))


@pytest.mark.parametrize("name", leading(sorted(LEVELS, key=lambda name: name == "strip"), len(LEVELS) - 1))
def test_no_larger_level_is_accepted(name):
    content = json.loads(text(name))
    numbers = claimed(content)["numbers"]
    numbers["level"] = str(Fraction(numbers["level"]) * Fraction(21, 20))
    with pytest.raises(RefusedError):
        check(json.dumps(content))


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("cycle", {"numbers": {"member.x": "0"}}, "V is too large at the member"),
        ("cycle", {"numbers": {"member.x": "3"}}, "outside of the box"),
        ("van der Pol", {"numbers": {"equilibrium.x": "1/10"}}, "V is not zero"),
        ("van der Pol", {"numbers": {"level": "-1"}}, "a bound is negative"),
        ("van der Pol", {"numbers": {"more": "1"}}, "nothing depends on more"),
        ("van der Pol", {"subject": {"box.x.0": "1"}}, "not inside of the box"),
        ("van der Pol", {"subject": {"box.x.0": "3"}}, "an interval is empty"),
        ("centre", {"numbers": {"direction.x": "0"}}, "not positive on the way"),
        ("barrier", {"numbers": {"start.x": "9"}}, "start is not shown to hold a state"),
        ("barrier", {"numbers": {"unsafe.x": "0"}}, "unsafe is not shown to hold a state"),
    ],
)
def test_what_a_theorem_needs_is_needed(name, change, said):
    content = json.loads(text(name))
    for key, own in change.items():
        claimed(content)[key] |= own
    with pytest.raises(RefusedError, match=said):
        check(json.dumps(content))


@pytest.mark.parametrize(
    ("rates", "V", "box", "numbers"),
    [
        # A line of rests; what no polynomial shows of all states (Ahmadi, Krstic and Parrilo); M that is not invariant.
        (lambda x, y: (-x, y - y), round_, SQUARE, ORIGIN | {"level": 1}),
        (lambda x, y: (-x + x * y, -y), round_, {}, ORIGIN),
        (lambda x, y: (1 - 0 * x, -y), lambda x, y: round_(x, y) - 1, SQUARE, {"member.x": 0, "member.y": 0, "level": 1}),
    ],
)
def test_false_claims_have_no_evidence(rates, V, box, numbers):
    assert not certificate(attempt("attracts", rates, {"V": V}, box, numbers)).startswith("{")


@pytest.mark.parametrize(("size", "level"), [(2, 2), (1, 1.49), (3, 2.9), (1, None)])
def test_a_start_set_that_is_not_below_the_level_has_no_evidence(size, level):
    functions = {"start": lambda x, y: size - round_(x, y), "V": slanted}
    told = ORIGIN if level is None else ORIGIN | {"level": level}
    assert not certificate(attempt("attracts", lambda x, y: (y, -x - y), functions, SQUARE, told)).startswith("{")


def test_a_start_set_is_what_a_claim_speaks_of():
    (proved,) = check(text("from a disc"))
    assert "start in {start >= 0} of the box stay in {V < 2} of the box and come to the equilibrium" in proved.statement.text


FAILS = [
    ("does not fall", lambda x, y: (-x + x * x * x, -y), round_, ("6/5", "1/10"), ("1/10", "0")),
    ("reaches the border", lambda x, y: (-x, -y), round_, ("2", "0"), ("1", "0")),
    ("is not positive", lambda x, y: (-x, -y), lambda x, y: x * x - y * y, ("1", "1"), ("1", "0")),
    ("does not grow", lambda x, y: (1 - x, -y), round_, ("-1", "1"), ("1/2", "0")),
    ("jumps", lambda x, y: (-x, -y), lambda x, y: where(less(0.0, x), round_(x, y), y), ("0", "2"), ("0", "1")),
]
"""What V does at the first state, and does not at the second."""


def slope_of(rates, V, x, y, step=1e-6):
    a, b = rates(x, y)
    return (V(x + step * a, y + step * b) - V(x - step * a, y - step * b)) / (2.0 * step)


SEEN = {
    "does not fall": lambda rates, V, x, y: V(x, y) > 0.0 and slope_of(rates, V, x, y) > 0.0,
    "does not grow": lambda rates, V, x, y: V(x, y) > 0.0 and slope_of(rates, V, x, y) <= 0.0,
    "reaches the border": lambda rates, V, x, y: max(abs(x), abs(y)) == 2.0,
    "is not positive": lambda rates, V, x, y: V(x, y) <= 0.0 and (x, y) != (0.0, 0.0),
    "jumps": lambda rates, V, x, y: abs(V(x + 1e-9, y) - V(x - 1e-9, y)) > 1e-6,
}
"""The same in floats."""


@pytest.mark.parametrize(("word", "rates", "V", "state", "other"), FAILS)
def test_refutations_are_states(word, rates, V, state, other):
    def tried(at):
        numbers = {} if word == "jumps" else ORIGIN
        numbers = numbers | {"state.x": at[0], "state.y": at[1]}
        return attempt("fails", rates, {"V": V}, SQUARE, numbers, taken=(word,))

    def seen(at):
        return SEEN[word](rates, V, *(float(Fraction(x)) for x in at))

    (proved,) = check(certificate(tried(state)))
    assert proved.statement.text
    assert seen(state)
    assert not seen(other)
    with pytest.raises(RefusedError, match=f"V is not shown to fail: {word}"):
        check(json.dumps(unproved(tried(other))))


def unproved(tried):
    """Return the certificate of a claim without evidence."""
    programs = {digest(program): program for program in tried.programs.values()}
    return {"format": "starhold certificate 3", "programs": programs, "claims": [tried.claim()]}


@pytest.mark.parametrize("name", leading([*SETS], 2))
def test_mutations_say_nothing_false(name):
    """Of what is accepted after a change nothing may be false, as flights and values in floats tell."""
    rng, accepted = random.Random(name), 0
    for _ in range(60):
        content = mutated(json.loads(text(name)), rng)
        try:
            check(json.dumps(content))
        except RefusedError:
            continue
        accepted += 1
        assert not false(content, rng), content["claims"]
    assert accepted < 60


def mutated(content, rng):
    """Return the content with one change: of a step of a program, a number, a side or a part of the evidence."""
    content = copy.deepcopy(content)
    claim = claimed(content)
    where = rng.choice(["program", "program", "numbers", "subject", "evidence"])
    if where == "program":
        role = rng.choice([*claim["programs"]])
        program = content["programs"].pop(claim["programs"][role])
        step = rng.choice(program["steps"])
        if step[0] == "constant":
            step[1] = str(Fraction(step[1]) * rng.choice([-1, 2, Fraction(9, 10), Fraction(11, 10), 0]))
        elif rng.random() < 0.5 and step[0] in ("plus", "minus", "product"):
            step[0] = rng.choice(["plus", "minus", "product"])
        else:
            step[rng.randrange(1, len(step))] = rng.randrange(len(program["inputs"]))
        content["programs"][digest(program)] = program
        for r, name in claim["programs"].items():
            if name not in content["programs"]:
                claim["programs"][r] = digest(program)
    elif where in ("numbers", "subject") and claim[where]:
        key = rng.choice([*claim[where]])
        claim[where][key] = str(
            Fraction(claim[where][key]) * rng.choice([-1, Fraction(11, 10), Fraction(1, 2)]) + rng.choice([0, 1])
        )
    else:
        key = rng.choice([*claim["evidence"]])
        claim["evidence"][key] = changed(claim["evidence"][key], rng)
    return content


def changed(part, rng):
    """Return a part of the evidence with one number changed, or an entry away."""
    if isinstance(part, dict) and part:
        key = rng.choice([*part])
        return part | {key: changed(part[key], rng)}
    if isinstance(part, list) and part:
        k = rng.randrange(len(part))
        return [changed(own, rng) if i == k else own for i, own in enumerate(part)] if rng.random() < 0.9 else part[:-1]
    return str(rational(part) * 2 + 1) if isinstance(part, str) and part[-1:].isdigit() else part


def false(content, rng, count=400):
    """Tell whether a claim is against values at random states."""
    claim = claimed(content)
    programs = {role: content["programs"][name] for role, name in claim["programs"].items()}
    inputs = programs["rates"]["inputs"]
    moving = inputs[: len(programs["rates"]["outputs"])]
    sides = {x: [float(Fraction(claim["subject"].get(f"box.{x}.{k}", (-3, 3)[k]))) for k in (0, 1)] for x in inputs}
    level = float(Fraction(claim["numbers"].get("level", 10**9)))

    def at(state):
        full = state | {f"{f}.{x}": getattr(math, f)(state[x]) for f in ("sin", "cos") for x in state}
        return {name: x for name, x in full.items() if name in inputs}

    def height(state, role="V"):
        return value(programs[role], at(state))[0]

    for _ in range(count):
        state = {x: rng.uniform(*sides[x]) for x in inputs if "." not in x}
        rates = value(programs["rates"], at(state))
        here = height(state)
        ahead = state | {x: state[x] + STEP * rate for x, rate in zip(moving, rates, strict=True)}
        slope, slack = (height(ahead) - here) / STEP, 1e-2 * (1 + abs(here))
        if claim["theorem"] == "avoids":
            if (height(state, "start") >= 0 and here > 1e-9) or (height(state, "unsafe") >= 0 and here < -1e-9):
                return True
        elif claim["theorem"] == "is unstable":
            if here > 1e-9 and slope < -slack:
                return True
        elif 1e-9 < here < level and slope > slack:
            return True
        if "start" in programs and "unsafe" not in programs and height(state, "start") >= 0 and here > level + 1e-9:
            return True
        if claim["theorem"] in ("attracts", "is stable"):
            x = rng.choice(moving)
            if f"box.{x}.0" in claim["subject"] and height(state | {x: rng.choice(sides[x])}) < level - 1e-9:
                return True
    return False
