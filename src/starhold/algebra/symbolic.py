"""How SymPy reads the scalar operations: exact expressions, selects as `Piecewise`."""

from __future__ import annotations

from typing import Any

import sympy


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
