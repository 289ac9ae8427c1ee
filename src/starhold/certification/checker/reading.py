"""The checker's own reading of a system that a certificate of an invariant set is about: texts to piecewise polynomials.

Only what stands here is read, nothing is run. Numbers stand for what is written. Nothing is shared with the certifier.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from starhold.algebra.polynomial import Polynomial, pieces
from starhold.algebra.scalar import absolute, less, maximum, minimum, sign, where
from starhold.certification.checker.exact import CheckError, demand

LONGEST, PIECES, TERMS, POWER = 2_000, 64, 600, 24
"""Characters of a text, pieces and terms of what it stands for, and powers: what is larger is not read."""
_ARGUMENTS = {"min": range(2, 9), "max": range(2, 9), "abs": [1], "clip": [2], "sat": [1, 2], "sign": [1], "where": [3]}


def read_names(names: Sequence[str], define: Mapping[str, Any]) -> dict[str, Any]:
    """Variables, parameters and what is defined from them, each later one from those before."""
    known: dict[str, Any] = {}
    for name in names:
        demand(name.isidentifier() and name not in _ARGUMENTS and name not in known, f"{name!r} is no name of a variable")
        known[name] = Polynomial.variable(name)
    for name, text in define.items():
        demand(name.isidentifier() and name not in _ARGUMENTS and name not in known, f"{name!r} cannot be defined")
        known[name] = read(text, known)
    return known


def read(text: Any, names: Mapping[str, Any]) -> Any:
    """What a text stands for; a CheckError where it holds anything else than it may."""
    demand(isinstance(text, (str, int, float)) and not isinstance(text, bool), "an expression is no text")
    line = " ".join(str(text).split())
    demand(len(line) <= LONGEST, "an expression is too long")
    try:
        return _Expression(line, names).value(ast.parse(line, mode="eval").body)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise CheckError(f"an expression cannot be read: {error}") from None


def number(text: Any) -> Fraction:
    """A number as it is written; none of so many digits that it could not be held."""
    power = str(text).lower().partition("e")[2]
    demand(len(power) <= 4 and len(str(text)) <= LONGEST, "a number has too many digits")
    return Fraction(str(text))


class _Expression:
    def __init__(self, line: str, names: Mapping[str, Any]) -> None:
        self.line, self.names = line, names

    def value(self, node: ast.expr) -> Any:
        found = self._value(node)
        parts = pieces(found)
        size = max((len(part.value.terms) for part in parts), default=0)
        degree = max((len(m) for part in parts for m in part.value.terms), default=0)
        demand(len(parts) <= PIECES and size <= TERMS and degree <= POWER, "an expression is too large")
        return found

    def _value(self, node: ast.expr) -> Any:
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            return Polynomial.constant(number(ast.get_source_segment(self.line, node)))
        if isinstance(node, ast.Name):
            demand(node.id in self.names, f"nothing is named {node.id!r}")
            return self.names[node.id]
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
            inner = self.value(node.operand)
            return -inner if isinstance(node.op, ast.USub) else inner
        if isinstance(node, ast.BinOp):
            return self._arithmetic(node)
        if isinstance(node, ast.IfExp):
            return self._either(node.test, self.value(node.body), self.value(node.orelse))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            return self._call(node.func.id, node.args)
        raise CheckError(f"an expression holds a {type(node).__name__}")

    def _arithmetic(self, node: ast.BinOp) -> Any:
        a = self.value(node.left)
        if isinstance(node.op, ast.Pow):
            power = node.right.value if isinstance(node.right, ast.Constant) else None
            demand(type(power) is int and 0 <= power <= POWER, "a power is no small whole number")
            total: Any = Polynomial.constant(1)
            for _ in range(int(str(power))):
                total = total * a
                demand(max(len(part.value.terms) for part in pieces(total)) <= TERMS, "a power is too large")
            return total
        b = self.value(node.right)
        if isinstance(node.op, ast.Add):
            return a + b
        if isinstance(node.op, ast.Sub):
            return a - b
        if isinstance(node.op, ast.Mult):
            return a * b
        demand(isinstance(node.op, ast.Div) and isinstance(b, Polynomial), "an operation is not + - * / **")
        demand(b.value is not None and b.value != 0, "a divisor is no number")
        return a / b

    def _call(self, name: str, nodes: list[ast.expr]) -> Any:
        demand(name in _ARGUMENTS and len(nodes) in _ARGUMENTS[name], f"{name!r} is no function, or of other arguments")
        if name == "where":
            return self._either(nodes[0], self.value(nodes[1]), self.value(nodes[2]))
        given = [self.value(node) for node in nodes]
        if name in ("min", "max"):
            found = given[0]
            for other in given[1:]:
                found = minimum(found, other) if name == "min" else maximum(found, other)
            return found
        if name == "abs":
            return absolute(given[0])
        if name == "sign":
            return sign(given[0])
        end = given[1] if len(given) == 2 else 1
        return minimum(maximum(given[0], -end), end)

    def _either(self, test: ast.expr, yes: Any, no: Any) -> Any:
        if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
            return self._either(test.operand, no, yes)
        if isinstance(test, ast.BoolOp):
            for part in test.values:
                both = isinstance(test.op, ast.And)
                yes, no = (self._either(part, yes, no), no) if both else (yes, self._either(part, yes, no))
            return yes if isinstance(test.op, ast.And) else no
        if not isinstance(test, ast.Compare):
            raise CheckError("what is chosen by is no comparison")
        sides = [self.value(side) for side in (test.left, *test.comparators)]
        for a, how, b in zip(sides[:-1], test.ops, sides[1:], strict=True):
            demand(isinstance(how, (ast.Lt, ast.LtE, ast.Gt, ast.GtE)), "a comparison is not < <= > >=")
            low, high = (a, b) if isinstance(how, (ast.Lt, ast.GtE)) else (b, a)
            strict = isinstance(how, (ast.Lt, ast.Gt))
            # a <= b is that not b < a.
            yes = where(less(low, high), yes, no) if strict else where(less(low, high), no, yes)
        return yes
