"""One equation under every reader, and the random numbers that the property tests feed it.

`agree` is the harness: it runs an equation with floats, compiled, with SymPy numbers and with balls, and compares.
"""

import math
import struct
from collections.abc import Callable, Iterator
from typing import Any

import sympy
from flint import ctx
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from starhold.loop.kernels import form
from starhold.trace.calling import Compiled
from tests.algebra.balls import UNDECIDED, Ball, arb_of

EXACT_BITS = 400
"""Precision of the balls that stand for the exact value."""


_COMPILED: dict[Any, Compiled] = {}


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The equation as a kernel runs it; compiled once for the whole test run for each form of its arguments."""

    def call(*arguments: Any) -> Any:
        key = (function, form(arguments))
        if key not in _COMPILED:
            _COMPILED[key] = Compiled(function, *arguments)
        return _COMPILED[key](*arguments)

    return call


def bits(number: Any) -> Any:
    """What must coincide for two results to be the same: every bit, the sign of zero included; any NaN is a NaN."""
    if isinstance(number, float):
        return "nan" if math.isnan(number) else struct.pack("<d", number)
    return number


def same(function: Callable[..., Any], *arguments: Any) -> Any:
    """The value of an equation, after checking that floats and the compiled equation give it bit for bit."""
    plain, fast = function(*arguments), compiled(function)(*arguments)
    assert list(map(bits, leaves(plain))) == list(map(bits, leaves(fast))), (function, arguments, plain, fast)
    return plain


def agree(function: Callable[..., Any], *arguments: Any) -> Any:
    """The value of an equation of finite numbers, after checking every reader.

    Floats and compiled code coincide bit for bit. Balls of working precision contain the exact value, which balls of
    `EXACT_BITS` enclose, and a truth they decide is the true one. Floats and SymPy lie within the rounding errors that
    the balls account for.
    """
    plain = same(function, *arguments)
    balls = list(leaves(function(*convert(arguments, Ball))))
    with ctx.workprec(EXACT_BITS):
        exact = list(leaves(function(*convert(arguments, Ball))))
    symbolic = list(leaves(function(*convert(arguments, sympy.Rational))))
    for value, ball, true, symbol in zip(leaves(plain), balls, exact, symbolic, strict=True):
        if value is None or isinstance(value, bool):
            assert value == true or true is UNDECIDED, (function, arguments, value, true)
            assert ball in (None, UNDECIDED, true), (function, arguments, ball, true)
            assert symbol is None or bool(symbol) == value, (function, arguments, value, symbol)
        else:
            assert contains(ball, true), (function, arguments, ball, true)
            room = 8.0 * radius(ball) + 4.0 * math.ulp(value)
            assert abs(value - middle(true)) <= room, (function, arguments, value, true)
            assert abs(float(symbol) - middle(true)) <= room, (function, arguments, symbol, true)
    return plain


def convert(argument: Any, kind: Callable[[float], Any]) -> Any:
    """The arguments with every float turned into another kind of number."""
    if isinstance(argument, tuple):
        parts = [convert(part, kind) for part in argument]
        return type(argument)(*parts) if hasattr(argument, "_fields") else tuple(parts)
    return kind(argument) if isinstance(argument, float) else argument


def leaves(value: Any) -> Iterator[Any]:
    """The numbers of a nested result in order."""
    if isinstance(value, tuple):
        for part in value:
            yield from leaves(part)
    else:
        yield value


def contains(ball: Any, other: Any) -> bool:
    """Whether a ball contains another (a number stands for itself)."""
    with ctx.workprec(EXACT_BITS):
        return arb_of(ball).contains(arb_of(other))


def middle(ball: Any) -> float:
    """The float nearest to the middle of a ball."""
    return float(arb_of(ball).mid())


def radius(ball: Any) -> float:
    """The radius of a ball."""
    return float(arb_of(ball).rad())


def close(a: Any, b: Any, tolerance: float) -> bool:
    """Whether two nested results agree within an absolute tolerance; NaN never does."""
    pairs = zip(leaves(a), leaves(b), strict=True)
    return all(abs(float(x) - float(y)) <= tolerance for x, y in pairs)


SPECIAL = (0.0, -0.0, 1.0, -1.0, 5e-324, -5e-324, 1e308, -1e308, math.inf, -math.inf, math.nan)

anything = st.floats() | st.sampled_from(SPECIAL)
numbers = st.one_of(
    st.sampled_from((0.0, 1.0, -1.0, 0.5, -2.0)),
    st.floats(1e-6, 1e6, allow_subnormal=False),
    st.floats(-1e6, -1e-6, allow_subnormal=False),
)
positives = st.floats(1e-6, 1e6)
components = st.floats(-1.0, 1.0).map(lambda x: x if abs(x) > 1e-9 else 0.0)
vectors = st.tuples(numbers, numbers, numbers)
small_vectors = st.tuples(components, components, components)
matrices = st.tuples(vectors, vectors, vectors)
directions = small_vectors.filter(lambda v: math.hypot(*v) > 1e-3)
angles = st.one_of(
    st.floats(-2.0 * math.pi, 2.0 * math.pi),
    st.floats(-15.0, -6.0).map(lambda e: 10.0**e),
    st.floats(-15.0, -6.0).map(lambda e: math.pi - 10.0**e),
    st.sampled_from((0.0, 1e-12, math.pi, -math.pi, 0.5 * math.pi)),
)
axis_turns = st.sampled_from(
    [(1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, -1.0, 0.0), (0.0, 0.0, 0.0, 1.0), (0.0, 0.6, -0.8, 0.0)]
)


def from_axis_angle(axis: Any, angle: float) -> Any:
    """The quaternion of a rotation by `angle` (rad) about `axis` (any length but zero)."""
    s = math.sin(0.5 * angle) / math.sqrt(axis[0] ** 2 + axis[1] ** 2 + axis[2] ** 2)
    return (math.cos(0.5 * angle), s * axis[0], s * axis[1], s * axis[2])


quaternions = st.builds(from_axis_angle, directions, angles) | axis_turns
"""Unit quaternions: any, next to no turn, next to 180 degrees, and exact ones."""


def reduced_by_unit_norm(expression: Any, q: Any) -> Any:
    """What is left of a polynomial in the components of q when q.q = 1."""
    exact = sympy.nsimplify(sympy.expand(expression), rational=True)
    return sympy.reduced(sympy.expand(exact), [sum(c * c for c in q) - 1], *q)[1]


def vanishes(expression: Any) -> bool:
    """Whether an expression with float constants is identically zero."""
    return sympy.cancel(sympy.together(sympy.nsimplify(sympy.expand(expression), rational=True))) == 0


def zero(expression: Any) -> bool:
    """Whether every component of an expression vanishes identically."""
    return all(map(vanishes, leaves(expression)))


def rotation(q: Any) -> Rotation:
    """The same rotation in SciPy."""
    return Rotation.from_quat(q, scalar_first=True)


def symbols(names: str) -> Any:
    """Real symbols as a tuple."""
    return tuple(sympy.symbols(names, real=True))
