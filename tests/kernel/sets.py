"""Claims about invariant sets for the kernel, made from equations in Python."""

import json
from fractions import Fraction
from functools import cache

from starhold.algebra.polynomial import Polynomial
from starhold.algebra.scalar import clip, maximum, sign
from starhold.certification.invariant.prover import Attempt, proved, scales
from starhold.certification.invariant.theorems import program
from starhold.kernel.numbers import rational
from starhold.kernel.programs import digest

SQUARE = {"x": (-2, 2), "y": (-2, 2)}
ORIGIN = {"equilibrium.x": 0, "equilibrium.y": 0}


def recorded(equation, names):
    """Return an equation as a program of the kernel."""
    found = equation(*map(Polynomial.variable, names))
    return program(found if isinstance(found, tuple) else (found,), names)


def attempt(theorem, rates, functions, box, numbers, names=("x", "y"), **more):
    """Return a claim that is to be proved; functions: V and others by their roles."""
    inputs = [*names, *more.pop("others", ())]
    programs = {"rates": recorded(rates, inputs)} | {role: recorded(f, inputs) for role, f in functions.items()}
    subject = {f"box.{x}.{k}": str(Fraction(end)) for x, ends in box.items() for k, end in enumerate(ends)}
    point = {name.partition(".")[2]: float(x) for name, x in numbers.items() if name.startswith("equilibrium")}
    sized = scales({x: (float(a), float(b)) for x, (a, b) in box.items()}, point)
    return Attempt(theorem, programs, subject, {name: str(Fraction(x)) for name, x in numbers.items()}, sized, **more)


def certificate(tried, top=float("inf"), escape=None):
    """Return the text of the certificate of a claim for which evidence is found; the reason where none is."""
    found = proved(tried, top, escape)
    if isinstance(found, str):
        return found
    programs = {digest(program): program for program in tried.programs.values()}
    return json.dumps({"format": "starhold certificate 3", "programs": programs, "claims": [found]})


def round_(x, y):
    return x * x + y * y


def slanted(x, y):
    return round_(x, y) + x * y


def cycle(x, y):
    return x * x + y * y - 1


def energy(p, r, q):
    m = p * p + 4 * q * q + 9 * r * r - 9
    return 2 * p * p + 2 * q * q + m * m / 9


def sliding(x, y):
    return -sign(x) + y / 4, -y


def saturated(x, s, r):
    return r * s - x, s - clip(2 * s, 1.0)


SETS = {
    "van der Pol": lambda: (
        attempt("attracts", lambda x, y: (-y, x - y + x * x * y), {"V": lambda x, y: 1.5 * x * x - x * y + y * y},
                {"x": ("-2.2", "2.2"), "y": ("-2.9", "2.9")}, ORIGIN), 2.3045),
    "cycle": lambda: (
        attempt("attracts", lambda x, y: (-y - x * cycle(x, y), x - y * cycle(x, y)),
                {"V": lambda x, y: cycle(x, y) * cycle(x, y)}, SQUARE, {"member.x": 1, "member.y": 0}), 1.0),
    "centre": lambda: (
        attempt("is unstable", lambda x, y: (-y - x * cycle(x, y), x - y * cycle(x, y)), {"V": round_},
                {"x": ("-0.5", "0.5"), "y": ("-0.5", "0.5")}, ORIGIN | {"direction.x": 1, "direction.y": 0}), float("inf")),
    "spin": lambda: (
        attempt("is stable", lambda p, r, q: (-q * r, -p * q / 3, p * r), {"V": energy},
                {"p": ("-1.25", "1.25"), "r": (0, "1.5"), "q": ("-1.25", "1.25")},
                {"equilibrium.p": 0, "equilibrium.r": 1, "equilibrium.q": 0}, ("p", "r", "q")), 3.125),
    "strip": lambda: (
        attempt("attracts", saturated, {"V": lambda x, s, r: maximum(s * s, x * x)},
                {"x": ("-1.1", "1.1"), "s": ("-1.1", "1.1"), "r": (0, "0.5")},
                {"equilibrium.x": 0, "equilibrium.s": 0}, ("x", "s"), others=("r",)), 1.0),
    "damped": lambda: (
        attempt("attracts", lambda x, y: (y, -x - y), {"V": round_}, SQUARE, ORIGIN), 4.0),
    "from a disc": lambda: (
        attempt("attracts", lambda x, y: (y, -x - y), {"start": lambda x, y: 1 - round_(x, y), "V": slanted}, SQUARE,
                ORIGIN | {"level": 2}), float("inf")),
    "sliding": lambda: (
        attempt("attracts", sliding, {"V": round_}, {"x": (-1, 1), "y": (-1, 1)}, ORIGIN), 1.0),
    "pendulum": lambda: (
        attempt("attracts", lambda x, v, s, c: (v, -s - v), {"V": lambda x, v, s, c: 2 * (1 - c) + x * v / 2 + v * v},
                {"x": (-2, 2), "v": (-4, 4)}, {"equilibrium.x": 0, "equilibrium.v": 0}, ("x", "v"),
                others=("sin.x", "cos.x")), 2.0),
    "everywhere": lambda: (
        attempt("attracts", lambda x, y: (-x * x * x + y, -x - y), {"V": round_}, {}, ORIGIN), float("inf")),
    "barrier": lambda: (
        attempt("avoids", lambda x, y: (-x, -y),
                {"start": lambda x, y: 1 - round_(x, y), "unsafe": lambda x, y: x - 2, "V": lambda x, y: round_(x, y) - 2},
                {}, {"start.x": 0, "start.y": 0, "unsafe.x": 2, "unsafe.y": 0}), float("inf")),
}  # fmt: skip


@cache
def text(name):
    """Return the certificate of one of these."""
    return certificate(*SETS[name]())


OPERATIONS = {
    "plus": lambda a, b: a + b, "minus": lambda a, b: a - b, "product": lambda a, b: a * b, "divide": lambda a, b: a / b,
    "negative": lambda a: -a, "less": lambda a, b: a < b, "less_equal": lambda a, b: a <= b,
    "select": lambda c, a, b: a if c else b,
}  # fmt: skip


def value(program, state):
    """Return the outputs of a program in floats."""
    values = [state[name] for name in program["inputs"]]
    for step in program["steps"]:
        if step[0] == "constant":
            values.append(float(rational(step[1])))
        else:
            values.append(OPERATIONS[step[0]](*(values[k] for k in step[1:])))
    return [values[k] for k in program["outputs"]]
