"""Records operations on handles as a tree of blocks."""

from __future__ import annotations

import inspect
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

from starhold.algebra.operations import ABSENT, INDEX, NUMBER, OPERATIONS, STATIC, TRUTH, WORD, Operation, refuse_absent
from starhold.algebra.structure import leaves, mapped
from starhold.algebra.structured import RECORDER, Buffer
from starhold.trace.handles import HANDLES, SHORTENED, Handle, Index, Number, kind_of, refuse, shortened
from starhold.trace.program import (
    Branch,
    Call,
    Function,
    Load,
    Loop,
    Memory,
    Op,
    Program,
    Slot,
    Store,
    Value,
    prune,
    reads,
    renamed,
    writes,
)

_WORDS = """
    arguments async auto await bool break case catch char class const continue debugger default delete do double else enum
    eval export extends extern false finally float for function goto if implements import in inline instanceof int
    interface let long new null package private protected public register restrict return short signed sizeof static struct
    super switch this throw true try typedef typeof undefined union unsigned var void volatile while with yield
    sqrt memcpy uint64_t INFINITY NAN NULL UINT64_C NaN Infinity Math Float64Array Int32Array
    bits_of with_bits high_bits low_bits
"""
RESERVED = frozenset(_WORDS.split())
"""Reserved words of the printed languages, which no variable may have as its name."""


MARK = "\u241e"
"""The delimiter around a number's index and format in a message that a check composes from recorded numbers."""

_CONSTANTS = {NUMBER: (float, int), TRUTH: (bool,), WORD: (int,), INDEX: (int,), STATIC: (int,)}


def _ref(value: Any) -> Value:
    return value.ref if isinstance(value, Handle) else value


class Cells:
    """The cells of a buffer in a memory of the trace."""

    def __init__(self, recorder: Recorder, memory: Memory) -> None:
        self.recorder, self.memory = recorder, memory

    def __getitem__(self, index: Any) -> Number:
        return self.recorder.load(self.memory, index)

    def __setitem__(self, index: Any, value: Any) -> None:
        self.recorder.store(self.memory, index, value)


class _Names:
    """Unique names for variables."""

    def __init__(self, taken: Iterable[str], mark: str = "") -> None:
        self._mark, self._taken, self._counts = mark, {*taken, *RESERVED}, Counter[str]()

    def new(self, hint: str) -> str:
        """Return the hint, numbered if it is taken. No name ends in an underscore, which marks values after a loop."""
        name = hint = (hint.strip("_") or "x") + self._mark
        while name in self._taken or name == "t":
            self._counts[hint] += 1
            name = f"{hint}{self._counts[hint]}"
        self._taken.add(name)
        return name


class Path:
    """One path through the comparisons of a check: the given answers, then False for all others. `truths` and `taken` are
    the comparisons met and their answers; `numbers` those that appear in a message."""

    def __init__(self, turns: Sequence[bool]) -> None:
        self.taken, self._turns = list[bool](), turns
        self.truths, self.numbers = list[Handle](), list[Handle]()

    def turn(self, truth: Handle) -> bool:
        """Return the answer to a comparison on this path; the same comparison always has the same answer."""
        known = next((place for place, met in enumerate(self.truths) if met.ref == truth.ref), None)
        if known is not None:
            return self.taken[known]
        self.taken.append(len(self.taken) < len(self._turns) and self._turns[len(self.taken)])
        self.truths.append(truth)
        return self.taken[-1]

    def shown(self, number: Handle, spec: str) -> str:
        """Return the mark that stands for a number in a message, as `refusals` reads it."""
        self.numbers.append(number)
        return f"{MARK}{len(self.numbers) - 1}:{spec}{MARK}"


class Recorder:
    """A recorder builds a tree of blocks from operations on handles; equal operations are recorded once."""

    by_rows = False
    """Whether `each` and `folded` of `algebra.several` are recorded for several rows at once."""

    def __init__(self) -> None:
        self.memories: list[Memory] = []
        self.path: Path | None = None
        """The path of a check through its comparisons, if one is recorded."""
        self._functions: dict[Any, tuple[Function, list[int], Any]] = {}
        self._open: list[list[Any]] = [[]]
        self._seen: list[dict[Any, Handle]] = [{}]
        self._names = _Names(())
        # Of the whole program: functions are recorded within one another.
        self._titles = _Names(())
        self._inputs: list[tuple[str, str]] = []

    def input(self, name: str, kind: str) -> Any:
        """Return an argument of the program: a count (`index`) or a `word`."""
        self._inputs.append((self._names.new(name), kind))
        return HANDLES[kind](self, self._inputs[-1][0])

    def memory(self, name: str, *, lanes: bool = False, writable: bool = False, size: int | None = None) -> Cells:
        """Return a memory that is an argument of the program."""
        self.memories.append(Memory(self._names.new(name), lanes, writable, size))
        return Cells(self, self.memories[-1])

    def each(self, equation: Callable[..., Any], rows: Sequence[Any], shared: Any) -> tuple[Any, ...]:
        """Record `each` of `algebra.several`, row by row."""
        return tuple(equation(*row, *shared) for row in rows)

    def lane(self) -> Any:
        """Return the number of the lane."""
        return self.apply(OPERATIONS["lane"], ())

    @contextmanager
    def recording(self) -> Generator[None]:
        """Inside this context, the forms of `algebra.structured` record here."""
        token = RECORDER.set(self)
        try:
            yield
        finally:
            RECORDER.reset(token)

    def program(self, name: str, doc: str = "") -> Program:
        """Return the program recorded so far."""
        body, _ = prune(tuple(self._open[0]), ())
        main = Function(self._titles.new(name), doc, tuple(self._inputs), body, ())
        return Program((*(function for function, _, _ in self._functions.values()), main), tuple(self.memories))

    def apply(self, operation: Operation, values: tuple[Any, ...]) -> Any:
        """Record an operation."""
        if len(values) != len(operation.takes):
            raise TypeError(f"{operation.name} takes {len(operation.takes)} values, not {len(values)}")
        if operation.name == "number_of" and kind_of(values[0]) == NUMBER:
            # A count kept from step to step is already a number.
            return values[0]
        refs = list[Value]()
        for value, kind in zip(values, operation.takes, strict=True):
            if isinstance(value, Handle):
                fits, ref = value.kind == kind, value.ref
            else:
                fits, ref = isinstance(value, _CONSTANTS.get(kind, ())) and (type(value) is not bool or kind == TRUTH), value
            if not fits:
                self._unfit(operation, value, kind)
            refs.append(float(ref) if kind == NUMBER and type(ref) is not str else ref)
        if operation.name in SHORTENED and (known := shortened(operation.name, values, refs)) is not None:
            return known
        # Equal constants of different types, or zeros of different signs, are not the same.
        key: Any = (operation.name, *(r if type(r) is str else (type(r), repr(r)) for r in refs))
        return self._once(key, lambda ref: Op(ref, operation, tuple(refs)), operation.gives)

    def _unfit(self, operation: Operation, value: Any, kind: str) -> NoReturn:
        if value is ABSENT:
            refuse_absent()
        given = value.kind if isinstance(value, Handle) else type(value).__name__
        wanted = {NUMBER: "a number", TRUTH: "a truth, as less gives", INDEX: "a count or a counter"}.get(kind, f"a {kind}")
        instead = "number_of(index)" if given == INDEX and kind == NUMBER else wanted
        refuse(f"{operation.name} of a value of kind {given}", instead)

    def _once(self, key: Any, make: Callable[[str], Any], gives: str) -> Any:
        for seen in self._seen:
            if key in seen:
                return seen[key]
        ref = self._names.new("t")
        self._open[-1].append(make(ref))
        return self._seen[-1].setdefault(key, HANDLES[gives](self, ref))

    def load(self, memory: Memory, index: Any) -> Number:
        """Record memory[index]."""
        self._check_index(index)
        ref = _ref(index)
        if not memory.writable:
            return self._once(("load", memory.name, ref), lambda name: Load(name, memory.name, ref), NUMBER)
        self._open[-1].append(Load(self._names.new("t"), memory.name, ref))
        return Number(self, self._open[-1][-1].ref)

    def store(self, memory: Memory, index: Any, value: Any) -> None:
        """Record memory[index] = value."""
        self._check_index(index)
        if kind_of(value) != NUMBER:
            refuse(f"a value of kind {kind_of(value)} in a buffer", "a number")
        if not memory.writable:
            refuse("writing to a table", "a buffer of the law's memory")
        self._open[-1].append(Store(memory.name, _ref(index), value.ref if isinstance(value, Handle) else float(value)))

    def _check_index(self, index: Any) -> None:
        if not isinstance(index, Index) and type(index) is not int:
            refuse("an index made of numbers", "a count, a loop's counter, or made of such by + - *")

    def loop(
        self, most: Any, done: Callable[..., Any] | None, body: Callable[..., Any], state: tuple[Any, ...], *, counted: bool
    ) -> tuple[Any, ...]:
        """Record `repeat` (counted: the body takes the counter) or `until`."""
        self._check_index(most)
        words = [*inspect.signature(body).parameters] + ["x"] * len(state)
        counter = self._names.new(words.pop(0).strip("_") if counted else "turn")
        names = self._named(state, words)
        inner = self._handles(state, names)
        head, stop = self._block(done, *inner) if done is not None else ((), None)
        if done is not None:
            self._check_done(head, stop)
        turn = [Index(self, counter)] if counted else []
        block, after = self._block(body, *turn, *inner)
        after = () if after is None else after
        kinds = [kind for _, kind in names]
        if INDEX in kinds:
            refuse("an index handed from turn to turn of a loop", "the loop's counter, or number_of(index)")
        given = [kind_of(x) for x in leaves(after) if not isinstance(x, Buffer)]
        if given != kinds:
            refuse(
                f"a turn of a loop that takes {', '.join(kinds) or 'nothing'} and gives {', '.join(given) or 'nothing'}",
                "the same",
            )
        pairs = zip(names, self._refs(state), self._refs(after), strict=True)
        slots = tuple(Slot(name, kind, before, then) for (name, kind), before, then in pairs)
        loop = Loop(counter, _ref(most), slots, head, None if done is None else _ref(stop), block)
        # A block that writes nothing is recorded once; a state with buffers may be written elsewhere.
        key = self._likeness((loop,), {}) if len(names) == len([*leaves(state)]) else None
        known: list[Any] = [seen[key] for seen in self._seen if key and key in seen]
        if not known:
            self._open[-1].append(loop)
            known = [self._handles(state, [(slot.end, slot.kind) for slot in slots])]
            self._seen[-1] |= {key: known[0]} if key else {}
        return known[0]

    def _likeness(self, block: tuple[Any, ...], names: dict[Value, int]) -> Any:
        """Return a key that is equal for blocks with the same computation, whatever their names, which are added to
        `names`; None for a block that calls, writes, or reads memory that is written."""
        keys: list[Any] = []

        def of(value: Value) -> Any:
            return names.get(value, value) if isinstance(value, str) else (type(value), repr(value))

        for s in block:
            if isinstance(s, Op):
                keys.append((s.operation.name, *map(of, s.args)))
                names[s.ref] = len(names)
            elif isinstance(s, Load) and not next(m for m in self.memories if m.name == s.memory).writable:
                keys.append((s.memory, of(s.index)))
                names[s.ref] = len(names)
            elif isinstance(s, Loop):
                begun = (of(s.most), *(of(slot.before) for slot in s.slots))
                names |= {name: len(names) + k for k, name in enumerate((s.counter, *(slot.name for slot in s.slots)))}
                inner = self._likeness(s.head, names), of(s.done), self._likeness(s.body, names)
                if None in inner:
                    return None
                keys.append((begun, inner, tuple(of(slot.after) for slot in s.slots)))
                names |= {slot.end: len(names) + k for k, slot in enumerate(s.slots)}
            else:
                return None
        return tuple(keys)

    def _check_done(self, head: tuple[Any, ...], stop: Any) -> None:
        if kind_of(stop) != TRUTH:
            refuse(f"a loop that ends by a value of kind {kind_of(stop)}", "a truth, as less gives")
        if writes(head):
            refuse("writing to a buffer to find out whether a loop is done", "writing in the turns of the loop")

    def branch(self, truth: Any, body: Callable[..., Any]) -> None:
        """Record `at`."""
        if isinstance(truth, bool):
            return body() if truth else None
        block, _ = self._block(body)
        self._open[-1].append(Branch(_ref(truth), block))
        return None

    def call(self, equation: Callable[..., Any], values: tuple[Any, ...]) -> Any:
        """Record a call of an equation, which is itself recorded once for each form of its arguments."""
        flat = [value for leaf in leaves(values) for value in self._parts(leaf)]
        key = (equation, self._form(values))
        if key not in self._functions:
            self._functions[key] = self._define(equation, values)
        function, kept, out = self._functions[key]
        refs = tuple((self._names.new("r"), kind) for _, kind in function.outs)
        self._open[-1].append(Call(refs, function, tuple(_ref(flat[place]) for place in kept)))
        return self._handles(out, list(refs))

    def _define(
        self, equation: Callable[..., Any], values: tuple[Any, ...], mark: str = ""
    ) -> tuple[Function, list[int], Any]:
        params: list[tuple[str, str]] = []

        def formal(word: str) -> Callable[[Any], Any]:
            def make(leaf: Any) -> Any:
                if isinstance(leaf, Buffer):
                    return Buffer(leaf.cells, make(leaf.base), make(leaf.size))
                if type(leaf) in (int, bool):
                    return leaf
                params.append((self._names.new(word), kind_of(leaf)))
                return HANDLES[params[-1][1]](self, params[-1][0])

            return make

        words = [*inspect.signature(equation).parameters]
        words += ["x"] * (len(values) - len(words))
        with self._alone(mark):
            given = [mapped(value, formal(word)) for value, word in zip(values, words, strict=True)]
            body, out = self._block(equation, *given)
        outs = self._refs(out)
        body, names = prune(body, outs)
        ends = tuple((renamed(x, names), kind_of(leaf)) for x, leaf in zip(outs, leaves(out), strict=True))
        used = {*reads(body), *(x for x, _ in ends)}
        kept = [place for place, (name, _) in enumerate(params) if name in used]
        params = [params[place] for place in kept]
        doc = inspect.cleandoc(equation.__doc__ or "")
        return Function(self._titles.new(getattr(equation, "__name__", "x")), doc, tuple(params), body, ends), kept, out

    @contextmanager
    def _alone(self, mark: str = "") -> Generator[None]:
        """Inside this context, record a function separately from the open blocks."""
        outer = self._open, self._seen, self._names
        self._open, self._seen, self._names = [], [], _Names((memory.name for memory in self.memories), mark)
        yield
        self._open, self._seen, self._names = outer

    def _parts(self, leaf: Any) -> list[Any]:
        """Yield the parts of an argument that are passed in the call: those not known while recording."""
        if isinstance(leaf, Buffer):
            return self._parts(leaf.base) + self._parts(leaf.size)
        return [] if type(leaf) in (int, bool) else [leaf]

    def _form(self, value: Any) -> Any:
        """Return a key that is equal for arguments that can share a recording."""
        if isinstance(value, tuple):
            return (type(value), *(self._form(part) for part in value))  # pyright: ignore
        if isinstance(value, Buffer):
            # If all numbers are known while recording, the list itself is the form.
            cells = value.cells.memory.name if isinstance(value.cells, Cells) else id(value.cells)
            return (cells, self._form(value.base), self._form(value.size))
        if value is None or type(value) in (int, bool):
            return (type(value), value)
        return kind_of(value)

    def _block(self, body: Callable[..., Any], *values: Any) -> tuple[tuple[Any, ...], Any]:
        self._open.append([])
        self._seen.append({})
        out = body(*values)
        self._seen.pop()
        return tuple(self._open.pop()), out

    def _named(self, state: tuple[Any, ...], words: list[str]) -> list[tuple[str, str]]:
        pairs: list[tuple[str, str]] = []
        for part, word in zip(state, words, strict=False):
            for label, leaf in _labelled(part, word.strip("_") or "x"):
                if not isinstance(leaf, Buffer):
                    pairs.append((self._names.new(label), kind_of(leaf)))
        return pairs

    def _handles(self, like: Any, names: list[tuple[Value, str]]) -> Any:
        source = iter(names)

        def make(leaf: Any) -> Any:
            if isinstance(leaf, Buffer):
                return leaf
            name, kind = next(source)
            return HANDLES[kind](self, name) if isinstance(name, str) else name

        return mapped(like, make)

    def _refs(self, value: Any) -> list[Value]:
        return [float(leaf) if type(leaf) is int else _ref(leaf) for leaf in leaves(value) if not isinstance(leaf, Buffer)]


def _labelled(value: Any, label: str) -> Generator[tuple[str, Any]]:
    """Return the leaves of a nested value, each under the name of its field."""
    if isinstance(value, tuple):
        names = getattr(value, "_fields", [label] * len(value))  # pyright: ignore
        for part, name in zip(value, names, strict=True):  # pyright: ignore
            yield from _labelled(part, name)
    elif value is not None:
        yield label, value
