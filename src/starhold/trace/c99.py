"""Prints a program as C99, for one lane: a function for each recorded one, of which the last is to be called.

Its arguments are the memories as pointers, then counts as `long` and words as `uint64_t`. From the library it uses only
`sqrt` (and `memcpy`, to read the bits of doubles). It allocates nothing, and gives the bits of plain Python if doubles are
IEEE doubles and the compiler contracts nothing (`-std=c99 -ffp-contract=off`, never `-ffast-math`).
"""

from typing import Any, ClassVar

from starhold.algebra.operations import INDEX, NUMBER, TRUTH, UNIFORM, WORD
from starhold.trace.program import Call, Function
from starhold.trace.source import TIE, Source, names

TYPES = {NUMBER: "double", TRUTH: "int", WORD: "uint64_t", INDEX: "long", UNIFORM: "int"}

_MATH = """
    acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim floor fma fmax fmin
    fmod frexp hypot ilogb ldexp lgamma llrint llround log log10 log1p log2 logb lrint lround modf nan nearbyint nextafter
    nexttoward pow remainder remquo rint round scalbln scalbn sin sinh sqrt tan tanh tgamma trunc
"""
_STRING = """
    memchr memcmp memcpy memmove memset strcat strchr strcmp strcoll strcpy strcspn strerror strlen strncat strncmp strncpy
    strpbrk strrchr strspn strstr strtok strxfrm
"""
GUARD = """\
#if defined(__FAST_MATH__) || (defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0)
#error "this code needs IEEE arithmetic in doubles: no -ffast-math, no x87"
#endif
#if !defined(__GNUC__) || defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif"""
_BITS_OF = """\
/* The bits of a double. */
static uint64_t bits_of(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}"""
_WITH_BITS = """\
/* The double with these bits. */
static double with_bits(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}"""
_HELPERS = {"bits_of": _BITS_OF, "with_bits": _WITH_BITS}


def helpers(body: str) -> list[str]:
    """Return the functions called by a text in C to convert doubles to bits and back; they need memcpy."""
    return [text for name, text in _HELPERS.items() if f"{name}(" in body]


class C99(Source):
    """Printer of C99. A function with one result returns it; one with several writes them to pointers."""

    language = "c"
    special: ClassVar = {"nan": "NAN", "inf": "INFINITY", "-inf": "-INFINITY"}
    types: ClassVar[dict[str, str]] = TYPES
    taken = frozenset(name + end for name in _MATH.split() for end in ("", "f", "l")) | frozenset((*_STRING.split(), "main"))

    def _opening(self) -> list[str]:
        called = helpers("\n".join(self.lines))
        lines = ["#include <math.h>", "#include <stdint.h>", *["#include <string.h>"] * bool(called), "", GUARD]
        for text in called:
            lines += ["", text]
        return lines

    def _head(self, function: Function) -> str:
        main = self.is_main(function)
        memories = self.program.memories if main else self.memories[function.name]
        given = [f"{'' if memory.writable else f'const{TIE}'}double{TIE}*{memory.name}" for memory in memories]
        given += [f"{self.types[kind]}{TIE}{name}" for name, kind in function.params]
        gives = "void"
        if len(function.outs) == 1:
            gives = self.types[function.outs[0][1]]
        else:
            outs = zip(function.outs, self._pointers(function), strict=True)
            given += [f"{self.types[kind]}{TIE}*{name}" for (_, kind), name in outs]
        return f"{'' if main else 'static '}{gives} {self.titles[function.name]}({', '.join(given) or 'void'})"

    def _pointers(self, function: Function) -> list[str]:
        """Return the names of the pointers to which a function writes its results."""
        used, mark = {*names(function), *self.titles.values(), *(memory.name for memory in self.program.memories)}, "out"
        count = len(function.outs)
        while not used.isdisjoint(f"{mark}{place}" for place in range(count)):
            mark += "_"
        return [f"{mark}{place}" for place in range(count)]

    def _define(self, function: Function) -> None:
        self.lines.append("")
        self.remark(function.doc)
        self.put(self._head(function))
        self.put("{")
        self.depth += 1
        memories = self.program.memories if self.is_main(function) else self.memories[function.name]
        for memory in memories:
            if memory not in self.memories[function.name]:
                self.put(f"(void){memory.name};")
        for name, _ in function.params:
            if name not in self._read:
                self.put(f"(void){name};")
        self._block(function.body)
        if len(function.outs) == 1:
            self.put(f"return {self.text(*function.outs[0])};")
        else:
            for pointer, (value, kind) in zip(self._pointers(function), function.outs, strict=True):
                self.put(f"*{pointer} = {self.text(value, kind)};")
        self.close()

    def _integer(self, value: Any, kind: str) -> str:
        return f"UINT64_C(0x{value:X})" if kind == WORD else str(int(value))

    def _declared(self, kind: str, changes: bool = False) -> str:
        return self.types[kind] if changes else f"const {self.types[kind]}"

    def _call(self, s: Call) -> None:
        function = self.functions[s.function.name]
        given = [memory.name for memory in self.memories[function.name]]
        given += [self.text(value, kind) for value, (_, kind) in zip(s.args, function.params, strict=True)]
        if len(s.refs) == 1 and s.refs[0][0] in self._read:
            name, kind = s.refs[0]
            self._let(kind, name, f"{self.titles[function.name]}({', '.join(given)})")
            return
        if len(s.refs) > 1:
            for name, kind in s.refs:
                self.put(f"{self.types[kind]} {name};")
            given += [f"&{name}" for name, _ in s.refs]
        self.put(f"{self.titles[function.name]}({', '.join(given)});")
