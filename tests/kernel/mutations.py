"""Ways to change one thing of a certificate of the kernel, and what it may say after that."""

import copy
import time
from fractions import Fraction

from starhold.kernel.check import check
from starhold.kernel.numbers import RefusedError, rational
from starhold.kernel.programs import OPERATIONS
from tests.kernel.certificates import rekeyed, text

WORDS = ["outside torque", "moving target", "wheels", "shortest sign", "hysteresis", "handed over", "memory", "plan"]
MORE = ["tolerance", "share", "noise.torque", "noise.torque.deviation", "told.change", "error.rate", "outside.per.rate"]
"""Numbers that not every claim has."""

LARGER = {"highest", "settling", "end.angle", "end.rate", "limit", "limit.norm", "fastest"}
SMALLER = {"angle", "rate", "start.angle", "start.rate", "tolerance", "momentum", "target.rate", "target.acceleration"}
PUSHED = ("outside", "error", "begun.")
"""Numbers of which a larger one, or a smaller one, makes a claim say less; and how those of what acts begin."""


def of_program(r, content, claim):
    """An operation, operand, order, output, input or constant is another one."""
    programs = [content["programs"][name] for name in sorted(claim["programs"].values())]
    program = r.choice([p for p in programs if any(s[0] != "constant" for s in p["steps"])])
    steps = [s for s in program["steps"] if s[0] != "constant"]
    constants = [s for s in program["steps"] if s[0] == "constant"]
    way = r.choice(["operation", "operand", "swap", "output", "fewer", "input", "twice", "constant"])
    step = r.choice(steps)
    if way == "operation":
        step[0] = r.choice(
            sorted({o for o, k in OPERATIONS.items() if len(k) == len(OPERATIONS[step[0]])} - {step[0]}) or ["plus"]
        )
    elif way == "operand":
        step[r.randrange(1, len(step))] = r.randrange(len(program["inputs"]) + program["steps"].index(step))
    elif way == "swap":
        step[1:] = step[:0:-1]
    elif way == "output":
        program["outputs"][r.randrange(len(program["outputs"]))] = r.randrange(
            len(program["inputs"]) + len(program["steps"])
        )
    elif way == "fewer":
        del program["outputs"][r.randrange(len(program["outputs"]))]
    elif way == "twice":
        program["inputs"][r.randrange(len(program["inputs"]))] = r.choice(program["inputs"])
    elif way == "input":
        i, k = (r.randrange(len(program["inputs"])) for _ in range(2))
        program["inputs"][i], program["inputs"][k] = program["inputs"][k], program["inputs"][i]
    elif constants:
        one = r.choice(constants)
        one[1] = str(rational(one[1]) * r.choice([-1, 2, Fraction(1001, 1000)]))


def of_number(part):
    def change(r, content, claim):
        """A number is larger, smaller, of the other sign, gone, or has a companion."""
        if not claim[part]:
            return
        name = r.choice(sorted(claim[part]))
        old = rational(claim[part][name])
        way = r.choice(["factor", "factor", "factor", "sign", "gone", "more"])
        if way == "factor":
            claim[part][name] = str(old * (1 + r.choice([-1, 1]) * Fraction(1, r.choice([2, 10, 100, 1000, 10**5]))))
        elif way == "sign":
            claim[part][name] = str(-old)
        elif way == "gone":
            del claim[part][name]
        else:
            claim[part][r.choice(["level", "limit", "angle", "rate", "fastest", "start.rate", "gains.more", *MORE])] = str(
                old
            )

    return change


def of_words(r, content, claim):
    """The loop is taken with more or less, the theorem is another one, or programs change roles."""
    way = r.choice(["words", "theorem", "roles"])
    if way == "words":
        word = r.choice(WORDS)
        claim["taken"] = [w for w in claim["taken"] if w != word] if word in claim["taken"] else [*claim["taken"], word]
    elif way == "theorem":
        claim["theorem"] = r.choice(
            ["converges", "converges strictly", "converges near the inertia", "converges whatever the inertia",
             "converges from both quaternions",
             "converges without a preferred axis", "stays stable between samples",
             "reaches its surface", "points", "points with appendages", "detumbles"])  # fmt: skip
    else:
        a, b = r.sample(sorted(claim["programs"]), 2)
        claim["programs"][a], claim["programs"][b] = claim["programs"][b], claim["programs"][a]


def of_evidence(r, content, claim):
    """A leaf of the evidence is another one, or evidence is gone, or stands under another name."""
    spots = []

    def walk(node):
        for key, part in node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ():
            if (isinstance(part, str) and part[-1:].isdigit()) or type(part) is int:
                spots.append((node, key))
            walk(part)

    walk(claim["evidence"])
    way = r.choice(["leaf", "leaf", "leaf", "gone", "moved"])
    if way == "leaf" and spots:
        node, key = r.choice(spots)
        if type(node[key]) is int:
            # A weight, a number of periods, a place.
            node[key] = r.choice([node[key] + 1, node[key] - 1, 2 * node[key], 0, -1, 10**6])
            return
        old = rational(node[key])
        node[key] = str(-old if old and r.random() < 0.5 else old + Fraction(1, 1000))
    elif claim["evidence"]:
        part = claim["evidence"].pop(r.choice(sorted(claim["evidence"])))
        if way == "moved":
            claim["evidence"][r.choice(["V is non-increasing", "inertia", "more", "step"])] = part


WAYS = [of_program, of_program, of_program, of_number("numbers"), of_number("subject"), of_words, of_evidence]


def says(content):
    """What a certificate claims, with exact numbers, without its evidence."""
    claim = content["claims"][0]
    numbers = {part: {name: rational(x) for name, x in claim[part].items()} for part in ("subject", "numbers")}
    return claim["theorem"], sorted(claim["taken"]), claim["programs"], numbers


def says_less(content, original):
    """Whether a claim, which is no refutation, follows from another one."""
    old, new = original["claims"][0], content["claims"][0]
    parts = ("theorem", "taken", "programs", "subject")
    if any(old[part] != new[part] for part in parts) or old["numbers"].keys() != new["numbers"].keys():
        return False
    for name, text_now in new["numbers"].items():
        before, now = rational(old["numbers"][name]), rational(text_now)
        smaller = name in SMALLER or name.startswith(PUSHED)
        if now != before and not (now > before and name in LARGER) and not (now < before and smaller):
            return False
    return new["theorem"].startswith(("converges", "points", "reaches"))


def refusals(original, r, count, true):
    """Change a certificate so many times, and return how many the kernel refuses; what it accepts says what the original
    says, or something that is true of its claim."""
    refused = tried = 0
    while tried < count:
        content = copy.deepcopy(original)
        r.choice(WAYS)(r, content, content["claims"][0])
        content = rekeyed(content)
        if content == original:
            continue
        tried, started = tried + 1, time.process_time()
        try:
            check(text(content))
        except RefusedError:
            refused += 1
        else:
            same = says(content) == says(original) or says_less(content, original)
            assert same or true(content, content["claims"][0]), content["claims"][0]
        assert time.process_time() - started < 20.0
    return refused
