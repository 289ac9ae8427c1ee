"""How SymPy reads the scalar operations: exact expressions, selects as `Piecewise`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

# Named at run time because its types are too loose for a strict checker.
sympy: Any = import_module("sympy")


def sqrt(x: Any) -> Any:
    return sympy.sqrt(x)


def less(a: Any, b: Any) -> Any:
    return sympy.StrictLessThan(a, b)


def where(condition: Any, a: Any, b: Any) -> Any:
    return sympy.Piecewise((a, condition), (b, True))


def both(a: Any, b: Any) -> Any:
    return sympy.And(a, b)


def either(a: Any, b: Any) -> Any:
    return sympy.Or(a, b)


def opposite(a: Any) -> Any:
    return sympy.Not(a)
