"""Prints a program as JavaScript (ES2017), for one lane: a function for each recorded one; the last is to be called.

Its arguments are the memories as Float64Arrays, then counts as numbers and words as pairs [high, low] of 32-bit integers,
which is the form of words everywhere here. It needs no library and no module, and gives the bits of plain Python.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

from starhold.algebra.operations import STATIC, TRUTH, UNIFORM, WORD
from starhold.trace.program import Call, Function, Op, Value
from starhold.trace.source import Source

_HELPERS = """\
const double_view = new Float64Array([1.0]);
const half_view = new Int32Array(double_view.buffer);
// Which half of a double in memory is the high one: of 1.0 the low one is zero.
const high_place = half_view[0] === 0 ? 1 : 0;

function high_bits(x) {
    double_view[0] = x;
    return half_view[high_place];
}

function low_bits(x) {
    double_view[0] = x;
    return half_view[1 - high_place];
}

function with_bits(high, low) {
    half_view[high_place] = high;
    half_view[1 - high_place] = low;
    return double_view[0];
}"""


class JavaScript(Source):
    """Printer of JavaScript. A function returns its result, or an array of several."""

    language = "javascript"
    special: ClassVar = {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}
    taken = frozenset(("double_view", "half_view", "high_place"))

    def _opening(self) -> list[str]:
        body = "\n".join(self.lines)
        used = any(f"{name}(" in body for name in ("high_bits", "low_bits", "with_bits"))
        return ['"use strict";', *["", _HELPERS] * used]

    def _define(self, function: Function) -> None:
        main = self.is_main(function)
        memories = self.program.memories if main else self.memories[function.name]
        given = [memory.name for memory in memories]
        for name, kind in function.params:
            given += [name] if main else self._parts(name, kind)
        self.lines.append("")
        self.remark(function.doc)
        self.open(f"function {self.titles[function.name]}({', '.join(given)})")
        for name, kind in function.params if main else ():
            if kind == WORD and name in self._read:
                high, low = self._parts(name, kind)
                self.put(f"const {high} = {name}[0] ^ 0, {low} = {name}[1] ^ 0;")
        self._block(function.body)
        outs = [text for value, kind in function.outs for text in self._texts_of_parts(value, kind)]
        if outs:
            self.put(f"return {outs[0]};" if len(outs) == 1 else f"return [{', '.join(outs)}];")
        self.close()

    def _integer(self, value: Any, kind: str) -> str:
        return str(bool(value)).lower() if kind in (TRUTH, UNIFORM) else str(value)

    def _declared(self, kind: str, changes: bool = False) -> str:
        return "let" if changes else "const"

    def _parts(self, name: str, kind: str) -> list[str]:
        # No name of a trace contains a dollar sign.
        return [f"{name}$high", f"{name}$low"] if kind == WORD else [name]

    def _texts_of_parts(self, value: Value, kind: str) -> list[str]:
        """Return the texts of a value: one, or for a word one per half."""
        if kind != WORD:
            return [self.text(value, kind)]
        if isinstance(value, str):
            return self._parts(value, kind)
        return [str(_signed(value >> 32)), str(_signed(value))]

    def _texts(self, s: Op) -> Sequence[str]:
        meaning: Any = s.operation.meanings["javascript"]
        if callable(meaning):
            meaning = meaning(*(value for value, kind in zip(s.args, s.operation.takes, strict=True) if kind == STATIC))
        texts: Sequence[str] = (meaning,) if isinstance(meaning, str) else meaning
        return texts

    def _op(self, s: Op) -> None:
        texts = self._texts(s)
        halves: dict[str, str] = {}
        for place, (value, kind) in enumerate(zip(s.args, s.operation.takes, strict=True)):
            if kind == WORD:
                halves[f"{place}h"], halves[f"{place}l"] = self._texts_of_parts(value, kind)
        if s.operation.gives != WORD:
            self._keep(s.ref, s.operation.gives, self.written(s, texts[0], halves))
            return
        high, low = self._parts(s.ref, WORD)
        self.put(f"const {low} = {self.written(s, texts[1], halves).text};")
        self.put(f"const {high} = {self.written(s, texts[0], {**halves, 'low': low}).text};")

    def _call(self, s: Call) -> None:
        function = self.functions[s.function.name]
        given = [memory.name for memory in self.memories[function.name]]
        for value, (_, kind) in zip(s.args, function.params, strict=True):
            given += self._texts_of_parts(value, kind)
        call = f"{self.titles[function.name]}({', '.join(given)})"
        parts = [part for name, kind in s.refs for part in self._parts(name, kind)]
        if not parts:
            self.put(f"{call};")
        else:
            self.put(f"const {parts[0]} = {call};" if len(parts) == 1 else f"const [{', '.join(parts)}] = {call};")


def _signed(half: int) -> int:
    """Return 32 bits as a signed integer, as bitwise operators of JavaScript do."""
    half &= 0xFFFFFFFF
    return half - (1 << 32) if half >= 1 << 31 else half
