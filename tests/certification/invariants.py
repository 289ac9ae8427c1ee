"""Systems and claims for the tests of invariant sets."""

from fractions import Fraction
from functools import cache

from starhold.algebra.polynomial import Polynomial
from starhold.certification.invariant import System, WantedSet, certify, load, prove
from starhold.certification.invariant.system import TURNED, turned
from starhold.certification.invariant.text import read

SQUARE = ((-2.0, 2.0), (-2.0, 2.0))
ORIGIN = "equilibrium = { x = 0, y = 0 }"


def file(x="-x", y="-y", V='"x**2 + y**2"', theorem="region", more=ORIGIN, name="mine", half=2):
    """The text of a problem about two states and one claim, in a square of these half sides."""
    return f"""
name = "{name}"
variables = ["x", "y"]
[rates]
x = "{x}"
y = "{y}"
[box]
x = [-{half}, {half}]
y = [-{half}, {half}]
[[claim]]
theorem = "{theorem}"
V = {V}
{more}
"""


def names(variables, angles=""):
    every = [*variables.split(), *(turned(f, x) for x in angles.split() for f in TURNED)]
    return {name: Polynomial.variable(name) for name in every}


def system(rates, variables="x y", parameters="", angles=""):
    """A system from texts."""
    known = names(f"{variables} {parameters}", angles)
    found = tuple(read(rate, known) for rate in rates)
    return System(tuple(variables.split()), found, tuple(parameters.split()), tuple(angles.split()))


def expression(text, variables="x y", angles=""):
    return read(text, names(variables, angles))


def claim(rates, theorem, V, box=SQUARE, equilibrium=None, level=None, escape=None, variables="x y", parameters="",
          angles="", **more):  # fmt: skip
    """What is shown of a claim that is written as texts."""
    every = f"{variables} {parameters}"
    indicator = tuple(expression(v, every) for v in V) if isinstance(V, (tuple, list)) else expression(V, every, angles)
    tool = None if escape is None else expression(escape, every)
    wanted = WantedSet(theorem, indicator, box, equilibrium, level, tool, **more)
    return prove(system(rates, variables, parameters, angles), wanted)


def outcomes(found):
    """Obligation to outcome."""
    return {o.name: o.outcome for o in found.obligations}


def fractions(state):
    """An exact state of evidence."""
    return {name: Fraction(x) for name, x in state.items()}


@cache
def proved(name):
    """A built-in problem and its certificate."""
    problem = load(name)
    return problem, certify(problem)
