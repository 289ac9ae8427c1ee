"""The scalar operations of which equations are made, for every reader.

An equation is a plain function over numbers and tuples of numbers. Python floats, a trace (which is printed as machine
code, C and JavaScript), SymPy symbols, dual numbers and exact polynomials all read the same function, so it may use only `+
- * /`, other equations, the operations of this module and the loops of `structured`: no `math`, no `if` on a number, no
NumPy array.

A comparison yields a `Truth`; only `where`, `both`, `either` and `opposite` consume it.
"""

from __future__ import annotations

import math
import operator as op
from typing import Any, TypeAlias, cast

from starhold.algebra.operations import EXACT, library, operation

Scalar: TypeAlias = float
"""A number of any reader; declared as float, which type checkers can follow."""
Truth: TypeAlias = Any
"""The type of a comparison: a bool, a SymPy relation, or a recorded truth."""


def _native(operator: Any) -> dict[str, Any]:
    """Return the meanings of a Python operator for readers whose numbers define it themselves."""
    return dict.fromkeys(EXACT, operator)


def _sympy(name: str) -> Any:
    return _of("sympy", name)


def _polynomial(name: str) -> Any:
    return _of("starhold.algebra.polynomial", name)


def _of(module: str, name: str) -> Any:
    """Return a function of a module that is loaded when it is first called."""

    def call(*values: Any) -> Any:
        return getattr(library(module), name)(*values)

    return call


@operation("number number", "number", llvm="fadd {number} {0}, {1}", c="{0} + {1}", javascript="{0} + {1}",
           **_native(op.add))  # fmt: skip
def plus(a: Scalar, b: Scalar) -> Scalar:
    """Return a + b, as `+` between numbers."""
    return a + b


@operation("number number", "number", llvm="fsub {number} {0}, {1}", c="{0} - {1}", javascript="{0} - {1}",
           **_native(op.sub))  # fmt: skip
def minus(a: Scalar, b: Scalar) -> Scalar:
    """Return a - b, as `-` between numbers."""
    return a - b


@operation("number number", "number", llvm="fmul {number} {0}, {1}", c="{0} * {1}", javascript="{0} * {1}",
           **_native(op.mul))  # fmt: skip
def product(a: Scalar, b: Scalar) -> Scalar:
    """Return a b, as `*` between numbers."""
    return a * b


@operation("number number", "number", llvm="fdiv {number} {0}, {1}", c="{0} / {1}", javascript="{0} / {1}",
           **_native(cast(Any, op).truediv))  # fmt: skip
def divide(a: Scalar, b: Scalar) -> Scalar:
    """Return a / b, infinite or NaN where b is zero, as in compiled code: for quotients that `where` may discard."""
    if b == 0.0:
        return math.nan if a == 0.0 or math.isnan(a) else math.copysign(math.inf, a) * math.copysign(1.0, b)
    return a / b


@operation("number", "number", llvm="fneg {number} {0}", c="-{0}", javascript="-{0}",
           **_native(op.neg))  # fmt: skip
def negative(a: Scalar) -> Scalar:
    """Return -a, as `-` before a number."""
    return -a


@operation("number", "number", llvm="call {number} @llvm.sqrt.{suffix}({number} {0})", c="sqrt({0})",
           javascript="Math.sqrt({0})", symbolic=_sympy("sqrt"), polynomial=_polynomial("sqrt"))  # fmt: skip
def sqrt(x: Scalar) -> Scalar:
    """Return the square root; NaN for a negative float, as in compiled code."""
    return math.sqrt(x) if x >= 0.0 else math.nan


@operation("number number", "truth", llvm="fcmp olt {number} {0}, {1}", c="{0} < {1}", javascript="{0} < {1}",
           symbolic=_sympy("StrictLessThan"), polynomial=_polynomial("less"))  # fmt: skip
def less(a: Scalar, b: Scalar) -> Truth:
    """Tell whether a < b."""
    return bool(a < b)


@operation("number number", "truth", llvm="fcmp ole {number} {0}, {1}", c="{0} <= {1}", javascript="{0} <= {1}",
           symbolic=_sympy("LessThan"), polynomial=_polynomial("less_equal"))  # fmt: skip
def less_equal(a: Scalar, b: Scalar) -> Truth:
    """Tell whether a <= b."""
    return bool(a <= b)


def _symbolic_select(condition: Any, a: Any, b: Any) -> Any:
    return library("sympy").Piecewise((a, condition), (b, True))


@operation("truth number number", "number", llvm="select {truth} {0}, {number} {1}, {number} {2}", c="{0} ? {1} : {2}",
           javascript="{0} ? {1} : {2}", symbolic=_symbolic_select,
           polynomial=_polynomial("where"))  # fmt: skip
def select(condition: Truth, a: Scalar, b: Scalar) -> Scalar:
    """Return what `where` does, for a condition that is not known while recording."""
    return a if condition else b


def where(condition: Truth, a: Scalar, b: Scalar) -> Scalar:
    """Return a where the condition holds, else b; both are always evaluated."""
    if condition is True or condition is False:
        return a if condition else b
    return select(condition, a, b)


@operation("truth truth", "truth", llvm="and {truth} {0}, {1}", c="{0} && {1}", javascript="{0} && {1}",
           symbolic=_sympy("And"), polynomial=_polynomial("both"))  # fmt: skip
def both(a: Truth, b: Truth) -> Truth:
    """Return the logical AND, without short circuit."""
    return a and b


@operation("truth truth", "truth", llvm="or {truth} {0}, {1}", c="{0} || {1}", javascript="{0} || {1}",
           symbolic=_sympy("Or"), polynomial=_polynomial("either"))  # fmt: skip
def either(a: Truth, b: Truth) -> Truth:
    """Return the logical OR, without short circuit."""
    return a or b


@operation("truth", "truth", llvm="xor {truth} {0}, {yes}", c="!{0}", javascript="!{0}",
           symbolic=_sympy("Not"), polynomial=_polynomial("opposite"))  # fmt: skip
def opposite(a: Truth) -> Truth:
    """Return the logical NOT."""
    return not a


def absolute(x: Scalar) -> Scalar:
    """Return |x|."""
    return where(less(x, 0.0), -x, x)


def minimum(a: Scalar, b: Scalar) -> Scalar:
    """Return the smaller number; a NaN in the second argument is returned."""
    return where(less(a, b), a, b)


def maximum(a: Scalar, b: Scalar) -> Scalar:
    """Return the larger."""
    return where(less(b, a), a, b)


def sign(x: Scalar) -> Scalar:
    """Return -1, 0 or +1; a NaN passes through."""
    return where(less(x, 0.0), -1.0, where(less(0.0, x), 1.0, x))


def side(x: Scalar) -> Scalar:
    """Return -1 for negative x, else +1: a sign that is never zero."""
    return where(less(x, 0.0), -1.0, 1.0)


def clip(x: Scalar, limit: Scalar) -> Scalar:
    """Keep x within [-limit, limit]; a NaN passes through."""
    return where(less(limit, x), limit, where(less(x, -limit), -limit, x))


def is_finite(x: Scalar) -> Truth:
    """Tell whether x is neither infinite nor NaN."""
    return less(absolute(x - x), 1.0)
