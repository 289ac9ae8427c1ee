"""Bounds on a program: every address lies within its memory, and no more operations are executed than are counted here.

Addresses are polynomials in counts and counters alone. A polynomial that is linear in a counter is greatest at an end of
the counter's range, which is a polynomial in the counters of the enclosing loops: so the bounds are attained, except for
some products of a counter with itself. Conditions on counters apply in their branch or loop.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from math import prod
from typing import Any, NamedTuple, TypeAlias

from starhold.algebra.operations import INDEX
from starhold.trace.program import Branch, Call, Function, Load, Loop, Op, Program, Store, Value

Interval: TypeAlias = tuple[int, int]
"""The lowest and the highest of a set of integers."""

KINDS = {
    "additions": ("plus", "minus"),
    "multiplications": ("product",),
    "divisions": ("divide",),
    "roots": ("sqrt",),
    "negations": ("negative",),
    "comparisons": ("less", "less_equal"),
    "selects": ("select",),
    "truths": ("both", "either", "opposite"),
    "words": ("word_add", "word_xor", "word_and", "word_or", "rotate_left", "shift_right", "lowest_bit", "bits_of",
              "with_bits", "word_of", "lane"),
    "indices": ("index_plus", "index_minus", "index_product", "same_index", "number_of"),
}  # fmt: skip
"""Operations by the field of `Work` that counts them."""
_KIND = {name: kind for kind, names in KINDS.items() for name in names}
_TRIED = 256
"""Most values of a counter tried one by one where a polynomial is not linear in it."""


class OutsideError(Exception):
    """A load or a store may lie outside its memory; the message names the function, the address and the memory."""


class Work(NamedTuple):
    """Upper bounds on how often each kind of operation is executed."""

    additions: int = 0
    multiplications: int = 0
    divisions: int = 0
    roots: int = 0
    negations: int = 0
    comparisons: int = 0
    selects: int = 0
    truths: int = 0
    words: int = 0
    indices: int = 0
    loads: int = 0
    stores: int = 0

    @property
    def arithmetic(self) -> int:
        """Return additions, multiplications, divisions and roots of numbers."""
        return self.additions + self.multiplications + self.divisions + self.roots

    def plus(self, other: Work) -> Work:
        """Return the sum of both."""
        return Work(*(a + b for a, b in zip(self, other, strict=True)))

    def times(self, count: int) -> Work:
        """Return this work times `count`."""
        return Work(*(count * a for a in self))


class Turns(NamedTuple):
    """An outermost loop: its counter, its largest number of iterations, and a bound on the work of one iteration."""

    counter: str
    most: int
    each: Work


class Bounds(NamedTuple):
    """Bounds of a program: its work, its outermost loops in order, and the lowest and highest index used in each memory."""

    work: Work
    loops: tuple[Turns, ...]
    places: dict[str, Interval]


def work(program: Program, counts: Mapping[str, int | Interval]) -> Bounds:
    """Return the bounds of a program for the given counts, each a number or an interval, for any contents of the memories.

    Work is counted as in plain Python and C, which do not test the end condition of a loop after its last iteration."""
    return _Walk(program, counts, None).bounds()


def check(program: Program, counts: Mapping[str, int | Interval], sizes: Mapping[str, int]) -> Bounds:
    """Return the bounds as `work` does. Raise OutsideError where an address may lie outside its memory of `sizes` numbers
    (for one lane)."""
    known = {memory.name: memory.size for memory in program.memories if memory.size is not None}
    return _Walk(program, counts, {**known, **sizes}).bounds()


class Form:
    """A polynomial with integer coefficients in symbols, which are numbered from the outermost loop inwards."""

    __slots__ = ("terms",)

    def __init__(self, terms: Mapping[tuple[int, ...], int]) -> None:
        self.terms = {symbols: c for symbols, c in terms.items() if c}

    def __add__(self, other: Form) -> Form:
        terms = Counter(self.terms)
        for symbols, c in other.terms.items():
            terms[symbols] += c
        return Form(terms)

    def __sub__(self, other: Form) -> Form:
        return self + constant(-1) * other

    def __mul__(self, other: Form) -> Form:
        terms = Counter[tuple[int, ...]]()
        for a, c in self.terms.items():
            for b, d in other.terms.items():
                terms[tuple(sorted(a + b))] += c * d
        return Form(terms)

    def text(self, names: Sequence[str]) -> str:
        """Return it as text in the names of the symbols, the constant last."""
        terms: list[str] = []
        for symbols, c in sorted(self.terms.items(), key=lambda term: (not term[0], term[0])):
            factors = [names[symbol] for symbol in symbols]
            if abs(c) != 1 or not factors:
                factors.insert(0, str(abs(c)))
            terms += ["-" if c < 0 else "+", " * ".join(factors)]
        return " ".join(terms[1:] if terms[:1] == ["+"] else terms) or "0"

    @property
    def last(self) -> int | None:
        """Return the innermost symbol."""
        return max((symbols[-1] for symbols in self.terms if symbols), default=None)

    @property
    def value(self) -> int:
        """Return its value; it must have no symbols."""
        return self.terms.get((), 0)

    def power(self, symbol: int) -> int:
        """Return the highest power of a symbol."""
        return max((symbols.count(symbol) for symbols in self.terms), default=0)

    def slope(self, symbol: int) -> int | None:
        """Return the coefficient of a symbol in which it is linear; None where the coefficient is not a number."""
        mixed = any(symbol in symbols and symbols != (symbol,) for symbols in self.terms)
        return None if mixed else self.terms.get((symbol,), 0)

    def at(self, symbol: int, value: Form) -> Form:
        """Return the polynomial with a symbol replaced by another polynomial."""
        total = Form({})
        for symbols, c in self.terms.items():
            part = Form({tuple(s for s in symbols if s != symbol): c})
            for _ in range(symbols.count(symbol)):
                part = part * value
            total += part
        return total


def constant(value: int) -> Form:
    """Return a polynomial without symbols."""
    return Form({(): value})


Ranges: TypeAlias = dict[int, tuple[Form, Form]]
"""The lowest and highest value of each symbol, as polynomials in symbols of enclosing loops."""


def extreme(form: Form, ranges: Ranges, highest: bool) -> int:
    """Return an upper (`highest`) or lower bound on the values of a polynomial."""
    symbol = form.last
    if symbol is None:
        return form.value
    pick = max if highest else min
    ends = ranges[symbol]
    if form.power(symbol) > 1:
        low, high = extreme(ends[0], ranges, False), extreme(ends[1], ranges, True)
        if high - low > _TRIED:
            return _by_intervals(form, ranges, highest)
        return pick(extreme(form.at(symbol, constant(k)), ranges, highest) for k in range(low, max(low, high) + 1))
    return pick(extreme(form.at(symbol, end), ranges, highest) for end in ends)


def _by_intervals(form: Form, ranges: Ranges, highest: bool) -> int:
    """Return a bound term by term: the value at the lowest value of each symbol, plus every term that moves it outwards at
    its largest."""
    above: dict[int, int] = {}
    for symbol in {symbol for symbols in form.terms for symbol in symbols}:
        low, high = extreme(ranges[symbol][0], ranges, False), extreme(ranges[symbol][1], ranges, True)
        above[symbol] = max(0, high - low)
        form = form.at(symbol, Form({(symbol,): 1, (): low}))
    return form.value + sum(
        c * prod(above[symbol] for symbol in symbols) for symbols, c in form.terms.items() if symbols and (c > 0) is highest
    )


def required(form: Form, ranges: Ranges) -> Ranges | None:
    """Return the ranges narrowed by the condition that a polynomial is not negative; None where it is always negative."""
    if extreme(form, ranges, highest=True) < 0:
        return None
    symbol = form.last
    slope = None if symbol is None else form.slope(symbol)
    if symbol is None or slope not in (1, -1):
        return ranges
    low, high = ranges[symbol]
    end = form.at(symbol, constant(0))
    if slope == 1:
        end = constant(0) - end
        narrow, kept = (end, high), extreme(end - low, ranges, False) >= 0
    else:
        narrow, kept = (low, end), extreme(high - end, ranges, False) >= 0
    if not kept:
        return ranges
    ranges = {**ranges, symbol: narrow}
    return required(narrow[1] - narrow[0], ranges)


class _Part(NamedTuple):
    """Work of a block per execution, and work done once in all iterations of the loop of a symbol."""

    each: Work
    once: dict[int, Work]

    def plus(self, other: _Part) -> _Part:
        once = dict(self.once)
        for symbol, more in other.once.items():
            once[symbol] = once.get(symbol, Work()).plus(more)
        return _Part(self.each.plus(other.each), once)


class _Walk:
    def __init__(self, program: Program, counts: Mapping[str, int | Interval], sizes: Mapping[str, int] | None) -> None:
        self.program, self.sizes = program, sizes
        self.names: list[str] = []
        self.loops: list[Turns] = []
        self.places: dict[str, Interval] = {}
        self.ranges: Ranges = {}
        self.depth = 0
        self.given: dict[str, Form] = {}
        for name, kind in program.main.params:
            if kind == INDEX:
                if name not in counts:
                    raise ValueError(f"no bounds for the count {name}")
                ends = counts[name]
                low, high = (ends, ends) if isinstance(ends, int) else ends
                if low > high:
                    raise ValueError(f"no number lies from {low} to {high}, the bounds of the count {name}")
                self.given[name] = self._symbol(name, constant(low), constant(high))

    def bounds(self) -> Bounds:
        part = self._block(self.program.main, self.program.main.body, self.given)
        return Bounds(sum_of([part.each, *part.once.values()]), tuple(self.loops), self.places)

    def _symbol(self, name: str, low: Form, high: Form) -> Form:
        self.names.append(name)
        self.ranges = {**self.ranges, len(self.names) - 1: (low, high)}
        return Form({(len(self.names) - 1,): 1})

    def _form(self, value: Value, known: dict[str, Form]) -> Form:
        return known[value] if isinstance(value, str) else constant(int(value))

    def _block(self, function: Function, block: tuple[Any, ...], known: dict[str, Form]) -> _Part:
        total = _Part(Work(), {})
        for s in block:
            if isinstance(s, Op):
                # Operations that only group numbers into structs are not counted.
                if (kind := _KIND.get(s.operation.name)) is not None:
                    total = total.plus(_Part(Work(**{kind: 1}), {}))
                self._note(s, known)
            elif isinstance(s, (Load, Store)):
                self._place(function, s, self._form(s.index, known))
                total = total.plus(_Part(Work(loads=1) if isinstance(s, Load) else Work(stores=1), {}))
            elif isinstance(s, Call):
                total = total.plus(self._call(s, known))
            elif isinstance(s, Branch):
                total = total.plus(self._branch(function, s, known))
            else:
                total = total.plus(self._loop(function, s, known))
        return total

    def _note(self, s: Op, known: dict[str, Form]) -> None:
        """Record the polynomial of an index, or for a comparison of two indices that of their difference."""
        if s.operation.name in ("index_plus", "index_minus", "index_product", "same_index"):
            a, b = (self._form(value, known) for value in s.args)
            if s.operation.name == "index_plus":
                known[s.ref] = a + b
            else:
                known[s.ref] = a * b if s.operation.name == "index_product" else a - b

    def _place(self, function: Function, s: Load | Store, place: Form) -> None:
        low, high = extreme(place, self.ranges, False), extreme(place, self.ranges, True)
        if self.sizes is not None:
            if s.memory not in self.sizes:
                raise ValueError(f"no size for the memory {s.memory}")
            if low < 0 or high >= self.sizes[s.memory]:
                what = f"{function.name}: {s.memory}[{place.text(self.names)}] may lie from {low} to {high}"
                raise OutsideError(f"{what}, and {s.memory} holds {self.sizes[s.memory]} numbers")
        ends = self.places.get(s.memory, (low, high))
        self.places[s.memory] = min(low, ends[0]), max(high, ends[1])

    def _call(self, s: Call, known: dict[str, Form]) -> _Part:
        if s.rows > 1:
            return _Part(self._block(s.function, s.function.body, {}).each.times(s.rows), {})
        pairs = zip(s.function.params, s.args, strict=True)
        inner = {name: self._form(value, known) for (name, kind), value in pairs if kind == INDEX}
        self.depth += 1
        part = self._block(s.function, s.function.body, inner)
        self.depth -= 1
        for (name, kind), (value, _) in zip(s.refs, s.function.outs, strict=True):
            if kind == INDEX:
                known[name] = self._form(value, inner)
        return part

    def _branch(self, function: Function, s: Branch, known: dict[str, Form]) -> _Part:
        outer, off = self.ranges, self._form(s.truth, known)
        inside = required(off, outer)
        inside = None if inside is None else required(constant(0) - off, inside)
        if inside is None:
            return _Part(Work(), {})
        self.ranges = inside
        part = self._block(function, s.body, known)
        self.ranges = outer
        # The branch is taken in a single iteration of the innermost loop whose counter it compares.
        if off.last is not None and off.slope(off.last):
            everything = sum_of([part.each, *part.once.values()])
            return _Part(Work(), {off.last: everything})
        return part

    def _loop(self, function: Function, s: Loop, known: dict[str, Form]) -> _Part:
        most = self._form(s.most, known)
        outer = self.ranges
        inside = required(most - constant(1), outer)
        if inside is None:
            return _Part(Work(), {})
        turns = extreme(most, inside, highest=True)
        self.ranges = inside
        known[s.counter] = self._symbol(s.counter, constant(0), most - constant(1))
        counter = len(self.names) - 1
        branch = s.most == 1
        self.depth += not branch
        part = self._block(function, s.head, known).plus(self._block(function, s.body, known))
        self.depth -= not branch
        self.ranges = outer
        if self.depth == 0 and not branch:
            self.loops.append(Turns(s.counter, turns, sum_of([part.each, *part.once.values()])))
        once = {symbol: more.times(turns) for symbol, more in part.once.items() if symbol != counter}
        return _Part(part.each.times(turns).plus(part.once.get(counter, Work())), once)


def sum_of(parts: list[Work]) -> Work:
    """Return the sum."""
    total = Work()
    for part in parts:
        total = total.plus(part)
    return total
