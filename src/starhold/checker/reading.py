"""The checker's own reading: of a file, and of a system that a certificate of an invariant set is about, texts to piecewise
polynomials. What is larger than the limits below is refused, with its line.

Only what stands here is read, nothing is run. Numbers stand for what is written.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

from starhold.algebra.polynomial import Polynomial, pieces
from starhold.algebra.scalar import absolute, less, maximum, minimum, sign, where
from starhold.checker.exact import CheckError, demand
from starhold.errors import InputError

BYTES, DEEPEST, DIGITS = 2**26, 32, 1_000
"""The largest file; how deep its objects and lists may be in one another; digits of a number."""
LONGEST, PIECES, TERMS, POWER = 2_000, 64, 600, 24
"""Characters of a text, pieces and terms of what it stands for, and powers: what is larger is not read."""
_ARGUMENTS = {"min": range(2, 9), "max": range(2, 9), "abs": [1], "clip": [2], "sat": [1, 2], "sign": [1], "where": [3]}


def read_file(path: Path | str) -> tuple[Any, list[str]]:
    """The content of a JSON file, and faults that its reading goes over; InputError where there is none that can be read."""
    faults: list[str] = []

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if len({key for key, _ in pairs}) < len(pairs):
            faults.append("a key occurs twice in one object")
        return dict(pairs)

    def not_a_number(text: str) -> None:
        faults.append(f"{text} is not a number")

    def whole(text: str) -> int:
        if len(text) > DIGITS:
            raise InputError(str(path), "", "", f"holds a number of more than {DIGITS} digits")
        return int(text)

    try:
        with open(path, "rb") as file:
            raw = file.read(BYTES + 1)
        if len(raw) > BYTES:
            raise InputError(str(path), "", "", f"is larger than {BYTES // 2**20} MiB")
        text = raw.decode("utf-8")
        return json.loads(text, object_pairs_hook=once, parse_constant=not_a_number, parse_int=whole), faults
    except OSError as error:
        raise InputError(str(path), "", "", f"cannot be read: {error.strerror}") from None
    except RecursionError:
        raise InputError(str(path), "", "", f"is nested more than {DEEPEST} deep") from None
    except ValueError as error:
        raise InputError(str(path), "", "", f"is not JSON: {error}") from None


def shallow(content: Any) -> None:
    """A CheckError where objects and lists are in one another deeper than they may."""
    inner: list[Any] = [content]
    for _ in range(DEEPEST):
        inner = [x for part in inner for x in _within(part)]
        if not inner:
            return
    raise CheckError(f"the file is nested more than {DEEPEST} deep")


def _within(part: Any) -> Iterable[Any]:
    if isinstance(part, dict):
        return cast(dict[Any, Any], part).values()
    return cast(list[Any], part) if isinstance(part, list) else ()


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
    """Read an expression; a CheckError where it holds anything else than it may."""
    demand(isinstance(text, (str, int, float)) and not isinstance(text, bool), "an expression is no text")
    line = " ".join(str(text).split())
    demand(len(line) <= LONGEST, "an expression is too long")
    try:
        return _Expression(line, names).value(ast.parse(line, mode="eval").body)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise CheckError(f"an expression cannot be read: {error}") from None


def number(text: Any) -> Fraction:
    """A number as it is written; none of so many digits that it could not be held."""
    digits, _, power = str(text).lower().partition("e")
    few = len(digits) <= DIGITS and len(power) <= 5 and abs(int(power or 0)) <= DIGITS
    demand(few, f"a number has more than {DIGITS} digits")
    return Fraction(str(text))


def _short(parts: Sequence[Any]) -> None:
    """A CheckError where a coefficient of piecewise polynomials has too many digits."""
    numbers = (c for part in parts for c in part.value.terms.values())
    short = all(max(int(c.p).bit_length(), int(c.q).bit_length()) < 4 * DIGITS for c in numbers)
    demand(short, f"a number has more than {DIGITS} digits")


class _Expression:
    def __init__(self, line: str, names: Mapping[str, Any]) -> None:
        self.line, self.names = line, names

    def value(self, node: ast.expr) -> Any:
        found = self._value(node)
        parts = pieces(found)
        size = max((len(part.value.terms) for part in parts), default=0)
        degree = max((len(m) for part in parts for m in part.value.terms), default=0)
        demand(len(parts) <= PIECES and size <= TERMS and degree <= POWER, "an expression is too large")
        _short(parts)
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
                parts = pieces(total)
                demand(len(parts) <= PIECES and max(len(p.value.terms) for p in parts) <= TERMS, "a power is too large")
                _short(parts)
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
