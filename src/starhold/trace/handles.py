"""Handles stand for values while equations are recorded; they record operations and refuse those that cannot be recorded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NoReturn

from starhold.algebra import scalar as scalar
from starhold.algebra import words as words
from starhold.algebra.operations import INDEX, NUMBER, OPERATIONS, TRUTH, UNIFORM, WORD, written_at
from starhold.errors import InputError

ELEMENTARY = "sin, cos, atan2, exp, log, power, cbrt and tanh of starhold.algebra.elementary"
INSTEAD = f"+ - * /, sqrt and the other operations of starhold.algebra.scalar, {ELEMENTARY}"


class RecordingError(InputError):
    """An equation cannot be recorded; the message names the law, the line of its file and what to write instead."""


class Handle:
    """A handle stands for a value while an equation is recorded."""

    __slots__ = ("recorder", "ref")
    reader = "record"
    kind = ""
    __hash__ = object.__hash__

    def __init__(self, recorder: Any, ref: str) -> None:
        self.recorder, self.ref = recorder, ref

    def __bool__(self) -> bool:
        if self.recorder.path is None or self.kind != TRUTH:
            refuse(
                "an `if`, `while`, `and`, `or` or `not` on a boolean that is not known yet",
                "where(truth, a, b), both, either, opposite",
            )
        return self.recorder.path.turn(self)

    def __float__(self) -> NoReturn:
        refuse("a function that is none of the scalar operations", INSTEAD)

    __int__ = __index__ = __complex__ = __float__  # pyright: ignore

    def _array(self, *_: Any, **__: Any) -> NoReturn:
        refuse("a function of NumPy", f"tuples, starhold.algebra.vector, {INSTEAD}")

    __array__ = __array_ufunc__ = __array_function__ = _array

    def _unknown(self, *_: Any) -> NoReturn:
        refuse("an operator that is none of the scalar operations", INSTEAD)

    def _powered(self, *_: Any) -> NoReturn:
        refuse("a power", "products, sqrt of starhold.algebra.scalar, power and cbrt of starhold.algebra.elementary")

    def __abs__(self) -> NoReturn:
        refuse("abs of a number", "absolute of starhold.algebra.scalar")

    __pow__ = __rpow__ = _powered
    __mod__ = __rmod__ = __floordiv__ = __rfloordiv__ = __matmul__ = __rmatmul__ = _unknown
    __round__ = __trunc__ = __floor__ = __ceil__ = __divmod__ = __iter__ = __len__ = __getitem__ = _unknown
    __invert__ = __and__ = __rand__ = __or__ = __ror__ = __xor__ = __rxor__ = __lshift__ = __rshift__ = _unknown

    def __format__(self, spec: str) -> str:
        return super().__format__(spec) if self.recorder.path is None else self.recorder.path.shown(self, spec)


def _compared(name: str, turned: bool = False) -> Any:
    def compare(self: Handle, other: Any) -> Any:
        if self.recorder.path is None:
            refuse(
                "a comparison of numbers by < > == or !=, or by `min` or `max`",
                "less or less_equal, and where(less(a, b), x, y); minimum, maximum",
            )
        return self.recorder.apply(OPERATIONS[name], (other, self) if turned else (self, other))

    return compare


def _equal(self: Handle, other: Any) -> Any:
    ends = _compared("less_equal")(self, other), _compared("less_equal", turned=True)(self, other)
    return self.recorder.apply(OPERATIONS["both"], ends)


def _different(self: Handle, other: Any) -> Any:
    return self.recorder.apply(OPERATIONS["opposite"], (_equal(self, other),))


for _name, _operator in {
    "__lt__": _compared("less"),
    "__le__": _compared("less_equal"),
    "__gt__": _compared("less", turned=True),
    "__ge__": _compared("less_equal", turned=True),
    "__eq__": _equal,
    "__ne__": _different,
}.items():
    setattr(Handle, _name, _operator)


def _binary(name: str, turned: bool = False) -> Any:
    entry = OPERATIONS[name]

    def apply(self: Handle, other: Any) -> Any:
        return self.recorder.apply(entry, (other, self) if turned else (self, other))

    return apply


class Number(Handle):
    """A handle that stands for a number."""

    __slots__ = ()
    kind = NUMBER
    __add__, __radd__ = _binary("plus"), _binary("plus", turned=True)
    __sub__, __rsub__ = _binary("minus"), _binary("minus", turned=True)
    __mul__, __rmul__ = _binary("product"), _binary("product", turned=True)
    __truediv__, __rtruediv__ = _binary("divide"), _binary("divide", turned=True)

    def __neg__(self) -> Any:
        return self.recorder.apply(OPERATIONS["negative"], (self,))

    def __pos__(self) -> Number:
        return self


class Opposite(Number):
    """A handle that stands for -x of a number x: the signs of its products and sums follow without an operation, and without
    rounding, so that a product with x serves for both."""

    __slots__ = ("other",)

    def __init__(self, other: Number) -> None:
        super().__init__(other.recorder, (-other).ref)
        self.other = other

    def __mul__(self, factor: Any) -> Any:
        return Opposite(self.other * factor)

    def __rmul__(self, factor: Any) -> Any:
        return Opposite(factor * self.other)

    def __add__(self, term: Any) -> Any:
        return term - self.other

    __radd__ = __add__

    def __rsub__(self, term: Any) -> Any:
        return term + self.other

    def __neg__(self) -> Any:
        return self.other


class Truth(Handle):
    """A handle that stands for the result of a comparison."""

    __slots__ = ()
    kind = TRUTH


class Word(Handle):
    """A handle that stands for a 64-bit unsigned integer."""

    __slots__ = ()
    kind = WORD


class Index(Handle):
    """An integer shared by all lanes: a count, a loop's counter, or a sum, difference or product of these."""

    __slots__ = ()
    kind = INDEX
    __add__, __radd__ = _binary("index_plus"), _binary("index_plus", turned=True)
    __sub__, __rsub__ = _binary("index_minus"), _binary("index_minus", turned=True)
    __mul__, __rmul__ = _binary("index_product"), _binary("index_product", turned=True)


class Uniform(Handle):
    """A truth about indices, shared by all lanes."""

    __slots__ = ()
    kind = UNIFORM


HANDLES: dict[str, type[Handle]] = {cls.kind: cls for cls in (Number, Truth, Word, Index, Uniform)}


def refuse(what: str, allowed: str) -> NoReturn:
    """Raise a RecordingError that names the line of the equation that runs now."""
    place, text = written_at()
    raise RecordingError(place, "", f"{what}, in `{text}`", allowed)


def kind_of(value: Any) -> str:
    """Return the kind of a recorded value or a constant."""
    if isinstance(value, Handle):
        return value.kind
    if isinstance(value, bool):
        return TRUTH
    if isinstance(value, (float, int)):
        return NUMBER
    refuse(f"a value of type {type(value).__name__}", "numbers, and tuples of them")


SHORTENED = frozenset(("both", "either", "same_index", "index_plus", "index_minus", "index_product"))
"""Operations whose result may follow from one known operand."""


def shortened(name: str, values: tuple[Any, ...], refs: Sequence[Any]) -> Any:
    """Return the result of an operation that follows from a known operand; None where none does."""
    if name in ("both", "either"):
        known = next((value for value in values if isinstance(value, bool)), None)
        if known is None:
            return None
        other = values[1] if values[0] is known else values[0]
        return other if known is (name == "both") else known
    if name == "same_index":
        return True if refs[0] == refs[1] else None
    if name == "index_product":
        return None if 1 not in refs else values[0] if refs[1] == 1 else values[1]
    if refs[1] == 0:
        return values[0]
    return values[1] if name == "index_plus" and refs[0] == 0 else None
