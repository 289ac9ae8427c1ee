"""Scalar operations that every reader of an equation understands, and `equation` itself.

An equation is a plain function over numbers and tuples of numbers. Python floats, Numba (one lane or many),
SymPy symbols, balls (python-flint `arb`) and exact polynomials all read the same text, so it may use only `+ - * /`,
other equations and the operations of this module: no `math`, no `if` on a number, no NumPy array.

A comparison yields a `Truth` (a bool, a SymPy relation, a condition on a polynomial, or for balls True, False or None when
undecided); only `where`, `both`, `either` and `opposite` consume it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any, TypeAlias, TypeVar, cast

from numba.extending import overload, register_jitable  # pyright: ignore[reportMissingTypeStubs, reportUnknownVariableType]

Scalar: TypeAlias = float
"""A number of any reader; typed as float, the reader that type checkers can follow."""
Truth: TypeAlias = Any
"""What a comparison yields: a bool, a SymPy relation, or True, False or None of balls."""

STRICT: dict[str, Any] = {"forceinline": True, "error_model": "numpy"}
"""Compiler options of an equation: inlined into kernels, IEEE arithmetic, division by zero gives inf as in C."""

_READERS = {
    "sympy": "starhold.algebra.symbolic",
    "flint": "starhold.algebra.balls",
    "starhold": "starhold.algebra.polynomial",
}

_Function = TypeVar("_Function", bound=Callable[..., Any])


def equation(function: _Function) -> _Function:
    """Mark a function as an equation: it stays plain Python, and is inlined where a compiled kernel calls it."""
    return register_jitable(**STRICT)(function)


def compiled_as(function: Callable[..., Any]) -> Callable[[_Function], _Function]:
    """Register the compiled meaning of a scalar operation, under the compiler options of an equation."""

    def register(maker: _Function) -> _Function:
        # Numba compares the maker's signature with that of the function it makes, annotations included.
        maker.__annotations__ = {}
        return overload(function, jit_options=cast(Any, STRICT))(maker)

    return register


def _reader(*numbers: Any) -> ModuleType | None:
    """The module that reads these numbers, or None when all are plain Python numbers."""
    for number in numbers:
        if not isinstance(number, (float, int)):
            root = type(number).__module__.partition(".")[0]
            if root not in _READERS:
                raise TypeError(f"no reader for numbers of type {type(number).__name__}")
            return import_module(_READERS[root])
    return None


def sqrt(x: Scalar) -> Scalar:
    """Square root; NaN for a negative float, as compiled code gives."""
    reader = _reader(x)
    if reader is not None:
        return reader.sqrt(x)
    return math.sqrt(x) if x >= 0.0 else math.nan


def less(a: Scalar, b: Scalar) -> Truth:
    """a < b."""
    reader = _reader(a, b)
    return bool(a < b) if reader is None else reader.less(a, b)


def where(condition: Truth, a: Scalar, b: Scalar) -> Scalar:
    """a where the condition holds, else b; both are always evaluated."""
    if isinstance(condition, bool):
        return a if condition else b
    return _truth_reader(condition).where(condition, a, b)


def both(a: Truth, b: Truth) -> Truth:
    """Logical and, without short circuit."""
    if isinstance(a, bool) and isinstance(b, bool):
        return a and b
    return _truth_reader(a, b).both(a, b)


def either(a: Truth, b: Truth) -> Truth:
    """Logical or, without short circuit."""
    if isinstance(a, bool) and isinstance(b, bool):
        return a or b
    return _truth_reader(a, b).either(a, b)


def opposite(a: Truth) -> Truth:
    """Logical not."""
    return not a if isinstance(a, bool) else _truth_reader(a).opposite(a)


def _truth_reader(*truths: Any) -> ModuleType:
    roots = {type(t).__module__.partition(".")[0] for t in truths}
    return import_module(_READERS[next((root for root in ("sympy", "starhold") if root in roots), "flint")])


# The compiled meanings. Each returns a lambda because Numba asks an overload for the function to compile.
compiled_as(sqrt)(lambda x: lambda x: math.sqrt(x))  # pyright: ignore
compiled_as(less)(lambda a, b: lambda a, b: a < b)  # pyright: ignore
compiled_as(where)(lambda condition, a, b: lambda condition, a, b: a if condition else b)  # pyright: ignore
compiled_as(both)(lambda a, b: lambda a, b: a & b)  # pyright: ignore
compiled_as(either)(lambda a, b: lambda a, b: a | b)  # pyright: ignore
compiled_as(opposite)(lambda a: lambda a: not a)  # pyright: ignore


@equation
def absolute(x: Scalar) -> Scalar:
    """|x|."""
    return where(less(x, 0.0), -x, x)


@equation
def minimum(a: Scalar, b: Scalar) -> Scalar:
    """The smaller; NaN in either argument is not hidden when it is the second."""
    return where(less(a, b), a, b)


@equation
def maximum(a: Scalar, b: Scalar) -> Scalar:
    """The larger."""
    return where(less(b, a), a, b)


@equation
def sign(x: Scalar) -> Scalar:
    """-1, 0 or +1; a NaN passes through."""
    return where(less(x, 0.0), -1.0, where(less(0.0, x), 1.0, x))


@equation
def side(x: Scalar) -> Scalar:
    """-1 for negative x, else +1: the sign that never vanishes."""
    return where(less(x, 0.0), -1.0, 1.0)


@equation
def clip(x: Scalar, limit: Scalar) -> Scalar:
    """x kept within [-limit, limit]; a NaN passes through."""
    return where(less(limit, x), limit, where(less(x, -limit), -limit, x))


@equation
def is_finite(x: Scalar) -> Truth:
    """True unless x is infinite or NaN."""
    return less(absolute(x - x), 1.0)
