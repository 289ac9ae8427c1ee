"""Prints a program as text that people read; common to C and JavaScript.

An operation whose result is read once is written where it is read, unless the text grows long; so is a load from a table,
but not from memory that may be written in between. Loops stay loops, and those of one iteration are branches.
"""

import math
import re
import textwrap
from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

from starhold.algebra.operations import INDEX, NUMBER, TRUTH, UNIFORM
from starhold.trace.program import (
    Branch,
    Call,
    Function,
    Load,
    Loop,
    Memory,
    Op,
    Program,
    Store,
    Value,
    reads,
    single_turns,
    statements,
)

WIDTH = 110
"""Longest line in characters, where it can be broken."""
TIE = "\N{NO-BREAK SPACE}"
"""Printed as a blank at which no line is broken."""
LONG, SHORT = 72, 28
"""Longest expressions in characters that are written where they are read: those read once, and those of indices."""

_CALL, _UNARY, _OTHER = "()", "unary", "other"
_LEVELS = {_CALL: 9, _UNARY: 8, "*": 7, "/": 7, "+": 6, "-": 6, "<": 5, "<=": 5, "==": 5, "===": 5,
           "&&": 4, "||": 4, "&": 4, "|": 4, "^": 4, ">>": 4, "?": 3, _OTHER: 0}  # fmt: skip
_BITS = ("&", "|", "^", ">>")


class Expression(NamedTuple):
    """The text of an expression, and its operator of lowest precedence."""

    text: str
    operator: str = _CALL


@cache
def operator_of(text: str) -> str:
    """Return the operator of a text with placeholders for its operands."""
    if match := re.fullmatch(r"\{0\} (\S+) (?:\{1\}|\d+)", text):
        return match[1] if match[1] in _LEVELS else _OTHER
    if re.fullmatch(r"(-|!|\(\w+\))\{0\}", text):
        return _UNARY
    if re.fullmatch(r"[\w.]+(\([^()]*\))?", text):
        return _CALL
    return "?" if text == "{0} ? {1} : {2}" else _OTHER


@cache
def _times(text: str, place: int) -> int:
    """Return how often a text contains an operand or its halves."""
    return len(re.findall(rf"\{{{place}[hl]?\}}", text))


def _stands(inner: str, outer: str, place: int) -> bool:
    """Return whether an operand needs no parentheses, not even to avoid a compiler's warning."""
    if outer == _CALL:
        return True
    if outer in _BITS:
        return _LEVELS[inner] > _LEVELS["*"]
    if outer in (_UNARY, _OTHER):
        return inner == _CALL
    if outer == "?":
        return _LEVELS[inner] > 3 or (inner == "?" and place == 2)
    if _LEVELS[inner] != _LEVELS[outer]:
        return _LEVELS[inner] > _LEVELS[outer]
    return place == 0 and (inner == outer or outer in "+-*/")


def fitted(inner: Expression, outer: str, place: int) -> str:
    """Return the text of an operand, in parentheses where it needs them."""
    return inner.text if _stands(inner.operator, outer, place) else f"({inner.text})"


class Source(ABC):
    """Printer for languages with braces. Memories keep their order as arguments, and counts and words come last."""

    language: ClassVar[str]
    special: ClassVar[dict[str, str]]
    """Numbers that are not finite, by their names in Python."""
    taken: ClassVar[frozenset[str]]
    """Names that no function may have, besides reserved words of the language."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self.lines: list[str] = []
        self.depth = 0
        called = _reached(program.main, {f.name: single_turns(f) for f in program.functions})
        self.functions = {f.name: called[f.name] for f in program.functions if f.name in called}
        self.memories = {name: self._touched(f) for name, f in self.functions.items()}
        used = {name for f in self.functions.values() for name in names(f)} | {memory.name for memory in program.memories}
        self.titles = _titles(list(self.functions), used | self.taken)
        self._once: set[str] = set()
        self._read: set[str] = set()
        self._folded: dict[str, Expression] = {}
        for function in self.functions.values():
            self._prepare(function)
            self._define(function)

    @property
    def name(self) -> str:
        """The name of the function to call."""
        return self.titles[self.program.main.name]

    def __str__(self) -> str:
        return "\n".join([*self._opening(), *self.lines]) + "\n"

    def is_main(self, function: Function) -> bool:
        """Return whether a function is the one to call."""
        return function.name == self.program.main.name

    def _touched(self, function: Function) -> list[Memory]:
        used = {s.memory for f in _reached(function, self.functions).values() for s in statements(f.body)
                if isinstance(s, (Load, Store))}  # fmt: skip
        return [memory for memory in self.program.memories if memory.name in used]

    # Texts of a language.

    @abstractmethod
    def _opening(self) -> list[str]:
        """Add the lines that come before the functions."""

    @abstractmethod
    def _define(self, function: Function) -> None:
        """Add a function."""

    @abstractmethod
    def _integer(self, value: Any, kind: str) -> str:
        """Return a Python truth or integer as a constant."""

    @abstractmethod
    def _declared(self, kind: str, changes: bool = False) -> str:
        """Return the text that precedes a name in its declaration."""

    @abstractmethod
    def _call(self, s: Call) -> None:
        """Call a function, and name its results."""

    # Text of the parts.

    def _constant(self, value: Any, kind: str) -> str:
        """Return a Python number as a constant."""
        if kind != NUMBER:
            return self._integer(value, kind)
        number = float(value)
        return repr(number) if math.isfinite(number) else self.special[str(number)]

    def _parts(self, name: str, kind: str) -> list[str]:
        """Return the names of a value's parts: the value, or the halves of a word."""
        return [name]

    def _halves(self, kind: str) -> int:
        """Return how many parts a value has."""
        return len(self._parts("", kind))

    def _texts_of_parts(self, value: Value, kind: str) -> list[str]:
        """Return the texts of a value's parts."""
        return [self.text(value, kind)]

    def _let(self, kind: str, name: str, text: str) -> None:
        """Name a value."""
        self.put(f"{self._declared(kind)} {name} = {text};")

    def _set(self, declared: str, name: str, value: Value, kind: str) -> None:
        """Declare a variable, or assign to it."""
        for part, text in zip(self._parts(name, kind), self._texts_of_parts(value, kind), strict=True):
            self.put(f"{declared}{part} = {text};")

    def put(self, line: str) -> None:
        """Add a line, broken where it is long, but not at `TIE`."""
        before = "    " * self.depth
        if line.strip() == line and 0 < len(line) <= WIDTH - len(before):
            # Most are short, and words take long to count.
            self.lines.append(before + line.replace(TIE, " "))
            return
        wide = textwrap.TextWrapper(WIDTH, before, before + "    ", break_long_words=False, break_on_hyphens=False)
        self.lines += [part.replace(TIE, " ") for part in wide.wrap(line)]

    def open(self, line: str) -> None:
        """Open a block in braces."""
        self.put(line + " {")
        self.depth += 1

    def close(self) -> None:
        """Close the block."""
        self.depth -= 1
        self.put("}")

    def remark(self, text: str) -> None:
        """Add a comment."""
        if text:
            text = text.replace("/*", "/ *").replace("*/", "* /")
            first, *rest = text.splitlines()
            self.lines += [f"/* {first}", *("   " + line if line else "" for line in rest)]
            self.lines[-1] += " */"

    def use(self, value: Value, kind: str) -> Expression:
        """Return the expression or the name that stands for a value."""
        if isinstance(value, str):
            return self._folded.get(value, Expression(value))
        text = self._constant(value, kind)
        return Expression(text, _UNARY if text.startswith("-") else _CALL)

    def text(self, value: Value, kind: str) -> str:
        """Return the text of a value that is no operand of another expression."""
        return self.use(value, kind).text

    # How often names are read.

    def _prepare(self, function: Function) -> None:
        """Find the values that are read once, and in the block that computes them."""
        home: dict[str, int] = {}
        seen: dict[Value, list[int]] = defaultdict(list)
        blocks = 0

        def walk(block: tuple[Any, ...], here: int) -> None:
            nonlocal blocks
            for s in block:
                if isinstance(s, (Op, Load)):
                    home[s.ref] = here
                elif isinstance(s, Call) and s.refs:
                    # Members of one variable, where it has any.
                    home[s.refs[0][0].partition(".")[0]] = here
                for value, times in self._operands(s):
                    seen[value] += [here] * times
                if isinstance(s, (Branch, Loop)):
                    blocks += 1
                    inner = blocks
                    if isinstance(s, Loop):
                        head = here if s.most == 1 else inner
                        walk(s.head, head)
                        seen[s.done].append(head)
                        for slot in s.slots:
                            seen[slot.after] += [inner] * self._halves(slot.kind)
                    walk(s.body, inner)

        walk(function.body, 0)
        for out, times in self._results(function):
            seen[out] += [0] * times
        self._once = {name for name, place in home.items() if seen.get(name) == [place]}
        self._read = {value for value in seen if isinstance(value, str)}
        self._folded = {}

    def _operands(self, s: Any) -> Iterator[tuple[Value, int]]:
        """Yield the values that a statement itself reads, and how often its text contains each."""
        if isinstance(s, Op):
            texts = self._texts(s)
            for place, value in enumerate(s.args):
                yield value, sum(_times(text, place) for text in texts)
        elif isinstance(s, Call):
            yield from ((value, self._halves(kind)) for value, (_, kind) in zip(s.args, s.function.params, strict=True))
        elif isinstance(s, Loop):
            yield s.most, 1
            yield from ((slot.before, self._halves(slot.kind)) for slot in s.slots)
        else:
            yield from ((value, 1) for value in reads((s._replace(body=()),) if isinstance(s, Branch) else (s,)))

    def _results(self, function: Function) -> Iterator[tuple[Value, int]]:
        """Yield the values that a function returns, and how often its text contains each."""
        yield from ((out, self._halves(kind)) for out, kind in function.outs)

    def _texts(self, s: Op) -> Sequence[str]:
        """Return the texts of an operation, one for each part of its result."""
        return (s.operation.meanings[self.language],)

    # Statements.

    def _block(self, block: tuple[Any, ...]) -> None:
        for s in block:
            if isinstance(s, Op):
                self._op(s)
            elif isinstance(s, Load):
                self._keep(s.ref, NUMBER, Expression(self._place(s)), moves=not self.program.memory(s.memory).writable)
            elif isinstance(s, Store):
                self.put(f"{self._place(s)} = {self.text(s.value, NUMBER)};")
            elif isinstance(s, Call):
                self._call(s)
            elif isinstance(s, Branch):
                self.open(f"if ({self.text(s.truth, UNIFORM)})")
                self._block(s.body)
                self.close()
            else:
                self._loop(s)

    def _place(self, s: Load | Store) -> str:
        """Return the text of a place in memory."""
        return f"{s.memory}[{self.text(s.index, INDEX)}]"

    def _op(self, s: Op) -> None:
        (text,) = self._texts(s)
        self._keep(s.ref, s.operation.gives, self.written(s, text))

    def written(self, s: Op, text: str, names: Mapping[str, str] = MappingProxyType({})) -> Expression:
        """Return the expression of an operation with its operands substituted; names: further names that its text uses."""
        if s.operation.name == "same_index" and (s.args[0] == s.args[1] or not any(isinstance(x, str) for x in s.args)):
            # Compilers warn of comparisons whose result is known.
            return Expression(self._constant(s.args[0] == s.args[1], UNIFORM))
        operator = operator_of(text)
        values = [self.use(value, kind) for value, kind in zip(s.args, s.operation.takes, strict=True)]
        return Expression(
            text.format(*(fitted(value, operator, place) for place, value in enumerate(values)), **names), operator
        )

    def _keep(self, ref: str, kind: str, expression: Expression, moves: bool = True) -> None:
        """Name a value, or keep its text to be written where it is read."""
        short = kind == INDEX and len(expression.text) <= SHORT
        if short or (moves and ref in self._once and len(expression.text) <= LONG):
            self._folded[ref] = expression
        else:
            self._let(kind, ref, expression.text)

    def _loop(self, s: Loop) -> None:
        for slot in s.slots:
            self._set(f"{self._declared(slot.kind, changes=True)} ", slot.end, slot.before, slot.kind)
        one, braces = s.most == 1, True
        if not one:
            begun, most = f"{self._declared(INDEX, changes=True)} {s.counter} = 0", self.text(s.most, INDEX)
            self.open(f"for ({begun}; {s.counter} < {most}; {s.counter}++)")
            # The values at the start of an iteration are kept while the variables change one after another.
            for slot in s.slots:
                ends = zip(self._parts(slot.name, slot.kind), self._parts(slot.end, slot.kind), strict=True)
                for part, end in ends if slot.name in self._read else ():
                    self._let(slot.kind, part, end)
        self._block(s.head)
        if s.done is not None and one:
            self.open(f"if ({self._denied(self.use(s.done, TRUTH))})")
        elif s.done is not None:
            self.put(f"if ({self.text(s.done, TRUTH)}) break;")
        else:
            braces = not one
        self._block(s.body)
        for slot in s.slots:
            self._set("", slot.end, slot.after, slot.kind)
        if braces:
            self.close()

    def _denied(self, truth: Expression) -> str:
        """Return the opposite of a truth."""
        if truth.text.startswith("!") and truth.operator == _UNARY:
            return re.sub(r"^\((.*)\)$", r"\1", truth.text[1:])
        return "!" + fitted(truth, _UNARY, 0)


def names(function: Function) -> Iterator[str]:
    """Return all names within a function."""
    yield from (name for name, _ in function.params)
    for s in statements(function.body):
        if isinstance(s, (Op, Load)):
            yield s.ref
        elif isinstance(s, Call):
            yield from (name for name, _ in s.refs)
        elif isinstance(s, Loop):
            yield s.counter
            yield from (name for slot in s.slots for name in (slot.name, slot.end))


def _reached(function: Function, functions: dict[str, Function]) -> dict[str, Function]:
    """Return a function and those that it calls, by name."""
    reached: dict[str, Function] = {}
    left = [function.name]
    while left:
        name = left.pop()
        if name not in reached:
            reached[name] = functions[name]
            left += [s.function.name for s in statements(reached[name].body) if isinstance(s, Call)]
    return reached


def _titles(names: list[str], taken: set[str]) -> dict[str, str]:
    """Return each function's name in the text, numbered where it is taken."""
    titles: dict[str, str] = {}
    for name in names:
        free = (f"{name}_{number}" if number else name for number in range(len(taken) + len(names) + 1))
        titles[name] = next(title for title in free if title not in taken)
        taken = taken | {titles[name]}
    return titles
