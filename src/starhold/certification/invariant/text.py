"""Reads expressions written by users, from a list of allowed elements, never evaluated as Python.

Arithmetic, whole powers, comparisons and the piecewise functions below make a piecewise polynomial with rational
coefficients. A number means exactly what is written: 0.1 is one tenth.
"""

import ast
import math
from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import reduce
from typing import Any

from starhold.algebra.polynomial import Cases, Polynomial, pieces
from starhold.algebra.scalar import absolute, less, maximum, minimum, sign, where
from starhold.certification.invariant.system import TURNED, turned

LONGEST = 20_000
"""The most characters of an expression."""
DIGITS = 3
"""The largest power of ten: floats have no more."""
MOST_DIGITS = 1_000
"""The most digits of a number, also of results."""
MOST_TERMS, MOST_CASES, HIGHEST, WORK, COMPARED = 600, 64, 24, 2_000_000, 10
"""Terms of a polynomial, cases of a piecewise one, the degree, and pairs of terms that are multiplied on the way to an
expression, a pair of cases that are compared counted as so many: beyond these a proof would not terminate."""
ALLOWED = "numbers, variables, + - * / **, comparisons, 'a if b else c', and where, min, max, abs, clip, sat, sign, sin, cos"


class ExpressionError(ValueError):
    """An expression that cannot be read: what was found, and what is allowed."""

    def __init__(self, written: str, allowed: str = ALLOWED) -> None:
        self.written, self.allowed = written, allowed
        super().__init__(f"found {written}; allowed: {allowed}")


def as_written(text: str) -> Fraction:
    """Return the number of a text: 0.1 is one tenth. ExpressionError for powers of ten that would fill the memory."""
    if len(text.lower().partition("e")[2].lstrip("+-")) > DIGITS:
        raise ExpressionError(text, f"a power of ten of at most {DIGITS} digits")
    return Fraction(text)


def _sat(x: Any, limit: Any = 1) -> Any:
    return minimum(maximum(x, -limit), limit)


_FUNCTIONS: dict[str, tuple[Callable[..., Any], int, int]] = {
    "min": (minimum, 2, 8),
    "max": (maximum, 2, 8),
    "abs": (absolute, 1, 1),
    "clip": (_sat, 2, 2),
    "sat": (_sat, 1, 2),
    "sign": (sign, 1, 1),
}
"""Functions by their names, with how many arguments they take at least and at most."""


def read(text: str, names: Mapping[str, Any]) -> Any:
    """The polynomial or piecewise polynomial that an expression is, over names that stand for such. ExpressionError says
    what it may not hold."""
    if len(text) > LONGEST:
        raise ExpressionError(f"{len(text)} characters", f"at most {LONGEST}")
    try:
        # In one line, so that a long one may be written in several.
        text = " ".join(text.split())
        return _Reader(text, names).number(ast.parse(text, mode="eval").body)
    except SyntaxError as error:
        raise ExpressionError(f"{_short(text)} ({error.msg})", "an expression") from None
    except (RecursionError, MemoryError):
        raise ExpressionError(_short(text), "a less deeply nested expression") from None
    except ValueError as error:
        if isinstance(error, ExpressionError):
            raise
        raise ExpressionError(f"{_short(text)} ({error})", "an expression") from None


def _size(value: Any) -> int:
    return sum(len(piece.value.terms) + 1 for piece in pieces(value))


class _Reader:
    """Goes down the tree; `number` and `_choose` know all the nodes there may be."""

    def __init__(self, text: str, names: Mapping[str, Any]) -> None:
        self._text, self._names, self._work = text, names, 0

    def number(self, node: ast.expr) -> Any:
        """The value of an expression."""
        return self._sized(self._number(node))

    def _number(self, node: ast.expr) -> Any:
        match node:
            case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
                return Polynomial.constant(as_written(ast.get_source_segment(self._text, node) or str(node.value)))
            case ast.Name(id=name):
                if name not in self._names:
                    known = ", ".join(x for x in self._names if x.isidentifier())
                    raise ExpressionError(f'the name "{name}"', f"one of {known}")
                return self._names[name]
            case ast.UnaryOp(op=ast.USub() | ast.UAdd(), operand=operand):
                value = self.number(operand)
                return -value if isinstance(node.op, ast.USub) else value
            case ast.BinOp():
                return self._operation(node)
            case ast.IfExp(test=test, body=body, orelse=other):
                return self._choose(test, self.number(body), self.number(other))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(name, arguments)
            case _:
                raise ExpressionError(self._shown(node))

    def _operation(self, node: ast.BinOp) -> Any:
        if isinstance(node.op, ast.Pow):
            return self._power(self.number(node.left), node.right)
        # A long sum is nested to the left.
        chain = [node]
        while isinstance(node.left, ast.BinOp) and not isinstance(node.left.op, ast.Pow):
            chain.append(node := node.left)
        value = self.number(node.left)
        for each in reversed(chain):
            value = self._sized(self._joined(each, value, self.number(each.right)))
        return value

    def _joined(self, node: ast.BinOp, a: Any, b: Any) -> Any:
        self._spend(_size(a), _size(b))
        match node.op:
            case ast.Add():
                return a + b
            case ast.Sub():
                return a - b
            case ast.Mult():
                return a * b
            case ast.Div():
                if isinstance(b, Cases) or b.value is None or b.value == 0:
                    raise ExpressionError(f"division by {self._shown(node.right)}", "a number other than zero below /")
                return a / b
            case ast.BitXor():
                raise ExpressionError(self._shown(node), "** for powers")
            case _:
                raise ExpressionError(self._shown(node))

    def _power(self, base: Any, node: ast.expr) -> Any:
        if not (isinstance(node, ast.Constant) and type(node.value) is int and 0 <= node.value <= HIGHEST):
            raise ExpressionError(f"the power {self._shown(node)}", f"a whole number from 0 to {HIGHEST}")
        product: Any = Polynomial.constant(1)
        for _ in range(node.value):
            self._spend(_size(product), _size(base))
            product = self._sized(product * base)
        return product

    def _sized(self, polynomial: Any) -> Any:
        """The value, if it is not too large; else an ExpressionError."""
        parts = pieces(polynomial)
        if len(parts) > MOST_CASES:
            raise ExpressionError(f"{len(parts)} pieces", f"at most {MOST_CASES}")
        for piece in parts:
            terms = piece.value.terms
            if len(terms) > MOST_TERMS or max(map(len, terms), default=0) > HIGHEST:
                raise ExpressionError("a polynomial that is too large", f"degree {HIGHEST} and {MOST_TERMS} terms")
            for number in (part for c in terms.values() for part in (int(c.p), int(c.q))):
                if number.bit_length() > MOST_DIGITS * 10 // 3:
                    raise ExpressionError("a number that is too long", f"at most {MOST_DIGITS} digits")
        return polynomial

    def _spend(self, *factors: int) -> None:
        """Count a product of numbers of terms or pieces as work."""
        self._work += math.prod(factors)
        if self._work > WORK:
            raise ExpressionError("an expression with too large intermediate results", "fewer pieces and terms")

    def _call(self, name: str, arguments: list[ast.expr]) -> Any:
        if name == "where" and len(arguments) == 3:
            return self._choose(arguments[0], self.number(arguments[1]), self.number(arguments[2]))
        if name in TURNED and len(arguments) == 1:
            angle = arguments[0].id if isinstance(arguments[0], ast.Name) else ""
            if turned(name, angle) not in self._names:
                raise ExpressionError(f"{name} of {self._shown(arguments[0])}", f"{name} of a variable")
            return self._names[turned(name, angle)]
        if name not in _FUNCTIONS:
            raise ExpressionError(f'the function "{name}"', f"one of where, {', '.join((*_FUNCTIONS, *TURNED))}")
        function, least, most = _FUNCTIONS[name]
        if not least <= len(arguments) <= most:
            raise ExpressionError(f"{name} with {len(arguments)} arguments", f"{least} to {most}")
        values = [self.number(argument) for argument in arguments]
        if name in ("min", "max"):
            return reduce(lambda one, other: self._sized(self._applied(function, one, other)), values)
        return self._applied(function, *values)

    def _applied(self, function: Callable[..., Any], *values: Any) -> Any:
        counts = [len(pieces(value)) for value in values]
        self._spend(COMPARED, math.prod(counts), sum(counts))
        return function(*values)

    def _choose(self, test: ast.expr, a: Any, b: Any) -> Any:
        """a where the test holds, else b."""
        match test:
            case ast.BoolOp(op=ast.And(), values=values):
                for value in values:
                    a = self._choose(value, a, b)
                return a
            case ast.BoolOp(op=ast.Or(), values=values):
                for value in values:
                    b = self._choose(value, a, b)
                return b
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return self._choose(operand, b, a)
            case ast.Compare(left=left, ops=operations, comparators=others):
                sides = [self.number(side) for side in (left, *others)]
                for one, operation, other in zip(sides[:-1], operations, sides[1:], strict=True):
                    a = self._compared(operation, one, other, a, b, test)
                return a
            case _:
                raise ExpressionError(self._shown(test), "a comparison, or several with and, or, not")

    def _compared(self, operation: ast.cmpop, one: Any, other: Any, a: Any, b: Any, test: ast.expr) -> Any:
        self._spend(COMPARED, *(len(pieces(value)) for value in (one, other)), len(pieces(a)) + len(pieces(b)))
        return self._sized(self._chosen(operation, one, other, a, b, test))

    def _chosen(self, operation: ast.cmpop, one: Any, other: Any, a: Any, b: Any, test: ast.expr) -> Any:
        match operation:
            case ast.Lt():
                return where(less(one, other), a, b)
            case ast.Gt():
                return where(less(other, one), a, b)
            case ast.LtE():
                return where(less(other, one), b, a)
            case ast.GtE():
                return where(less(one, other), b, a)
            case _:
                raise ExpressionError(self._shown(test), "< <= > >=")

    def _shown(self, node: ast.expr) -> str:
        return _short(ast.get_source_segment(self._text, node) or type(node).__name__)


def _short(text: str) -> str:
    text = " ".join(text.split())
    return f'"{text}"' if len(text) <= 60 else f'"{text[:57]}..."'


RESERVED = frozenset({"where", *_FUNCTIONS, *TURNED})
"""Names that no variable may have."""
