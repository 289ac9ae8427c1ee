"""The texts of a law in C: header, source and the file that builds them."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from typing import Any, NamedTuple

from starhold.algebra.structure import leaves
from starhold.algebra.structured import Buffer
from starhold.export.code import Code
from starhold.export.memory import helpers
from starhold.export.printing import Readable
from starhold.export.proof import UNPROVED, Proof
from starhold.export.types import Member, Type, comment
from starhold.parts.contract import fields
from starhold.version import __version__

WIDTH = 110


class Text(NamedTuple):
    """The files of a law by name."""

    header: str
    source: str


def texts(code: Code, scenario: str, law: str, proof: Proof = UNPROVED) -> Text:
    """Return header and source. scenario, law: names that the scenario's file gives."""
    printed = code.printed
    public = {name: f"{code.name}_{name.removeprefix('flight_')}" for name in _public(code)}
    return Text(_header(code, printed, public, scenario, law, proof), _source(code, printed, public))


def _public(code: Code) -> list[str]:
    """Return the types that callers see, those of members first."""
    found: dict[str, Type] = {}

    def visit(kind: Type) -> None:
        for member in code.printed.members(kind):
            visit(member.type)
        if kind.members:
            found.setdefault(kind.name, kind)

    for kind in _interface(code):
        visit(kind)
    return list(found)


def _interface(code: Code) -> tuple[Type, Type, Type]:
    shape = code.signature
    assert shape.result is not None
    command = shape.result.members[0].type
    return shape.params[1].type, shape.params[2].type, command


def _header(code: Code, printed: Readable, public: dict[str, str], scenario: str, law: str, proof: Proof) -> str:
    name, loop = code.name, code.flight.loop
    card = loop.law.card
    guard = f"{name.upper()}_H"
    lines = [*_banner(code, scenario, law, proof), "", f"#ifndef {guard}", f"#define {guard}", ""]
    lines += ["#ifdef __cplusplus", 'extern "C" {', "#endif", ""]
    lines += [
        f"/* {code.time_unit}: the step is to be called once in each such period. */",
        f"#define {name.upper()}_PERIOD ({loop.period!r})",
        "",
    ]
    types = _types(code, printed)
    for own in public:
        if own != STATE.name:
            lines += [*declaration(types[own], printed, public, {}), ""]
    lines += [*_state(code, printed, public), ""]
    lines += comment(
        "Sets the state to that of the scenario's start"
        + (": the side of the quaternion is that of its initial attitude." if "sign" in code.flight.start._fields else ".")
    )
    lines += [f"void {name}_init({name}_state_t *state);", ""]
    lines += comment(
        f"One control step: {card.summary}. Takes what was measured at this instant, gives what to command until the next, "
        "and changes the state. It calls nothing but sqrt and keeps nothing outside the state. It does not check what it is "
        "given: a NaN that the law uses comes out as one."
    )
    lines += [f"void {name}_step({name}_state_t *state, const {name}_input_t *input, {name}_command_t *command);", ""]
    lines += ["#ifdef __cplusplus", "}", "#endif", "", f"#endif /* {guard} */", ""]
    return "\n".join(lines)


STATE = Type("flight_state_t", named=True)


def _state(code: Code, printed: Readable, public: dict[str, str]) -> Iterator[str]:
    """Yield the declaration of the state."""
    kind, public = code.signature.params[1].type, {**public, STATE.name: f"{code.name}_state_t"}
    if not _has_state(code):
        yield from comment("What the law remembers: nothing. C has no empty structs.")
        yield "typedef struct {"
        yield "    double unused;"
        yield f"}} {code.name}_state_t;"
        return
    yield from comment("What is remembered from step to step: set it by the function below, and leave it alone.")
    yield from declaration(kind if kind.members else STATE, printed, public, code.buffers)


def _banner(code: Code, scenario: str, law: str, proof: Proof) -> list[str]:
    loop = code.flight.loop
    card, work = loop.law.card, code.work
    found = [
        f"{code.name}: {card.title}",
        "",
        f"{card.summary}",
        "",
        f"Made by starhold {__version__} from the scenario {scenario}, law {law}.",
    ]
    found += [f"Source: {source}" for source in card.sources]
    found += [f"Assumes: {'; '.join(card.assumptions)}.", ""]
    found += [f"Command limit: {_limit(loop)}. Quaternion sign: {loop.sign_policy.replace('_', ' ')}."]
    found += _choices(loop)
    done = f"{work.arithmetic} additions, multiplications, divisions and roots, and {work.comparisons} comparisons"
    found += ["", f"A step does at most {done}.",
              "Bits are those of the simulation where doubles are IEEE and nothing is contracted or reassociated:",
              "compile with -std=c99 -ffp-contract=off, never with -ffast-math."]  # fmt: skip
    found += [""]
    if proof.warning:
        found += ["*" * 100, *(f"WARNING  {line}" for line in proof.warning.splitlines()), "*" * 100]
    if proof.file:
        found += ["", f"Certificate: {proof.file}, sha256 {proof.digest}: {proof.outcome}", "Claims:"]
        found += [f"  {line}" for line in proof.claims]
        found += [f"These claims assume: {'; '.join(proof.assumptions)}."] if proof.assumptions else []
        found += [f"Check it independently: {proof.recheck}"]
    return comment("\n".join(found))


def _limit(loop: Any) -> str:
    unit = {"torque": "N m"}.get(loop.body.module.COMMAND, "")
    return (
        "none"
        if loop.limit == "none"
        else f"{loop.cutoff():.12g} {unit} by {loop.limit}".replace(" by axis", " on each axis").replace(
            "by norm", "in norm"
        )
    )


def _choices(loop: Any) -> list[str]:
    """Return the gains that are constants of this code."""
    found: list[str] = []
    for field in fields(type(loop.gains)):
        value = getattr(loop.gains, field.name)
        if field.gain.choices:
            found.append(f"{field.name} = {field.gain.choices[value]}")
        elif field.gain.whole:
            found.append(f"{field.name} = {value}")
    return [f"Fixed in this code: {', '.join(found)}."] if found else []


def _source(code: Code, printed: Readable, public: dict[str, str]) -> str:
    name = code.name
    lines = comment(
        f"{name}.c: made by starhold {__version__}; see {name}.h. Do not edit: change the scenario and export it again."
    )
    includes = (
        ["#include <math.h>"]
        if any("sqrt(" in line or "INFINITY" in line for line in printed.lines) or _unlimited(code)
        else []
    )
    types = _types(code, printed)
    body = "\n".join(printed.lines)
    includes += ["#include <stdbool.h>"] if re.search(r"\bbool\b", body) else []
    includes += ["#include <stdint.h>"] if "int32_t" in body or code.buffers else []
    lines += ["", f'#include "{name}.h"', "", *includes, *([""] if includes else []), GUARD, ""]
    shown = {kind: own for kind, own in public.items() if not kind.startswith("flight_")}
    lines += [f"typedef {own} {kind};" for kind, own in shown.items()]
    lines += [""] if shown else []
    for kind in types.values():
        if kind.name not in public and kind.name != "parameters_t":
            lines += [*declaration(kind, printed, {}, {}), ""]
    parameters = code.signature.params[0].type
    if printed.members(parameters):
        lines += [*declaration(parameters, printed, {}, {}), "", *_values(code, printed), ""]
    for memory in code.buffers:
        parts = printed.parts.get(memory, {})
        if parts:
            lines += [*comment(f"Where the parts of {memory} begin."), "enum {"]
            lines += [f"    {part.upper()}_AT = {first}," for first, part in sorted(parts.items())]
            lines += ["};"]
    lines += helpers(list(printed.rows.values()))
    module = ""
    for function in printed.functions.values():
        if printed.is_main(function):
            continue
        own = getattr(function.shape, "module", module) or module
        if own != module:
            module = own
            lines += ["", _rule(own.removeprefix("starhold."))]
        lines += printed.chunks[function.name]
    lines += ["", _rule("interface"), "", *_init(code), ""]
    lines += [f"void {name}_step({name}_state_t *state, const {name}_input_t *input, {name}_command_t *command)", "{"]
    chunk = printed.chunks[code.program.main.name]
    if not any(re.search(r"\bstate\b", line) for line in chunk) and not code.buffers:
        lines += ["    (void)state;"]
    lines += [f"    double *const {memory} = state->{memory};" for memory in code.buffers]
    lines += [*chunk, "}", ""]
    return "\n".join(lines)


GUARD = """\
#if defined(__FAST_MATH__) || (defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0)
#error "this code needs IEEE arithmetic in doubles: no -ffast-math, no x87"
#endif
#if !defined(__GNUC__) || defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif"""


def _rule(title: str) -> str:
    return f"/* {f' {title} '.center(88, '-')} */"


def _unlimited(code: Code) -> bool:
    return any(leaf in (float("inf"), float("-inf")) for leaf in leaves(code.flight.parameters) if isinstance(leaf, float))


def _has_state(code: Code) -> bool:
    return bool(code.flight.start._fields)


def _types(code: Code, printed: Readable) -> dict[str, Type]:
    """Return all types that are used, those of members first."""
    found: dict[str, Type] = {}

    def visit(kind: Type) -> None:
        for member in printed.members(kind):
            visit(member.type)
        if kind.members:
            found.setdefault(kind.name, kind)

    for kind in (*printed.used.values(), code.signature.params[0].type, *_interface(code)):
        if printed.members(kind):
            visit(kind)
    return found


def declaration(kind: Type, printed: Readable, public: dict[str, str], arrays: dict[str, int]) -> Iterator[str]:
    """Yield the lines of a struct; arrays: names and sizes of more members."""
    if kind.text:
        yield from comment(kind.text)
    yield "typedef struct {"
    if kind.elements:
        yield f"    {_called(kind.members[0].type, public)} {kind.elements}[{len(kind.members)}];"
    else:
        members = printed.members(kind)
        same = bool(members) and len({m.type for m in members}) == 1 and not any(m.text for m in members) and not kind.named
        if same:
            yield f"    {_called(members[0].type, public)} {', '.join(m.name for m in members)};"
        for member in () if same else members:
            yield from _member(member, public)
    for name, size in arrays.items():
        yield f"    double {name}[{size}];"
    yield f"}} {public.get(kind.name, kind.name)};"


def _member(member: Member, public: dict[str, str]) -> Iterator[str]:
    line = f"    {_called(member.type, public)} {member.name};"
    note = f" /* {member.text.replace('*/', '* /')} */" if member.text else ""
    if len(line + note) > WIDTH:
        yield from ("    " + part for part in comment(member.text))
        yield line
    else:
        yield line + note


def _called(kind: Type, public: dict[str, str]) -> str:
    return public.get(kind.name, kind.name)


def _values(code: Code, printed: Readable) -> Iterator[str]:
    """Yield the lines of the constants."""
    yield "static const parameters_t parameters = {"
    source = iter([leaf for leaf in leaves(code.flight.parameters) if isinstance(leaf, float)])
    yield from _fields(code.signature.params[0].type, source, printed, 1)
    yield "};"


def _fields(kind: Type, source: Iterator[float], printed: Readable, depth: int) -> Iterator[str]:
    live = printed.members(kind)
    for member in kind.members:
        if member not in live:
            for _ in range(_count(member.type)):
                next(source)
        elif member.type.named:
            yield f"{'    ' * depth}.{member.name} = {{"
            yield from _fields(member.type, source, printed, depth + 1)
            yield f"{'    ' * depth}}},"
        else:
            note = f" /* {member.text.partition(':')[0]} */" if ":" in member.text else ""
            yield f"{'    ' * depth}.{member.name} = {_constant(member.type, source, printed)},{note}"


def _count(kind: Type) -> int:
    return sum(_count(member.type) for member in kind.members) if kind.members else 1


def _constant(kind: Type, source: Iterator[float], printed: Readable) -> str:
    if not kind.members:
        return printed.constant(next(source))
    inner = ", ".join(_constant(member.type, source, printed) for member in kind.members)
    return f"{{{{{inner}}}}}" if kind.elements else f"{{{inner}}}"


def _init(code: Code) -> Iterator[str]:
    """Yield the lines that set the state to its start."""
    name, printed = code.name, code.printed
    start = code.flight.start
    kind = code.signature.params[1].type
    floats = iter([leaf for leaf in leaves(start) if isinstance(leaf, float)])
    held = [leaf for leaf in leaves(start) if isinstance(leaf, Buffer)]
    firsts = {
        memory: _trimmed([buffer[k] for k in range(buffer.size)]) for memory, buffer in zip(code.buffers, held, strict=True)
    }
    for memory, first in firsts.items():
        if first:
            yield f"/* What {memory} begin with; the rest are zeros. */"
            yield f"static const double first_{memory}[{len(first)}] = {{"
            yield from textwrap.wrap(
                ", ".join(map(printed.constant, first)), WIDTH, initial_indent="    ", subsequent_indent="    "
            )
            yield "};"
            yield ""
    yield f"void {name}_init({name}_state_t *state)"
    yield "{"
    if not _has_state(code):
        yield "    state->unused = 0.0;"
    for member in kind.members if code.signature.params[1].leaves else ():
        value = _constant(member.type, floats, printed)
        if member.type.members:
            yield f"    const {member.type.name} {member.name} = {value};"
            yield f"    state->{member.name} = {member.name};"
        else:
            yield f"    state->{member.name} = {value};"
    for memory, first in firsts.items():
        size = code.buffers[memory]
        yield f"    for (int32_t k = 0; k < {size}; k++) {{"
        yield (
            f"        state->{memory}[k] = k < {len(first)} ? first_{memory}[k] : 0.0;"
            if first
            else f"        state->{memory}[k] = 0.0;"
        )
        yield "    }"
    yield "}"


def _trimmed(numbers: list[float]) -> list[float]:
    while numbers and numbers[-1] == 0.0 and str(numbers[-1]) == "0.0":
        numbers.pop()
    return numbers


CMAKE = """\
# {name}: a library, and a self-test that demands the bits of the simulation.
cmake_minimum_required(VERSION 3.13)
project({name} LANGUAGES C)

add_library({name} STATIC {name}.c)
target_include_directories({name} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})
set_target_properties({name} PROPERTIES C_STANDARD 99 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF)
if(CMAKE_C_COMPILER_ID MATCHES "GNU|Clang")
  target_compile_options({name} PUBLIC -ffp-contract=off PRIVATE -Wall -Wextra -pedantic)
endif()
find_library(MATH m)
if(MATH)
  target_link_libraries({name} PUBLIC ${{MATH}})
endif()

enable_testing()
add_executable({name}_selftest {name}_selftest.c)
set_target_properties({name}_selftest PROPERTIES C_STANDARD 99 C_STANDARD_REQUIRED ON)
target_link_libraries({name}_selftest PRIVATE {name})
add_test(NAME {name}_selftest COMMAND {name}_selftest)
"""


def cmake(name: str) -> str:
    """Return the text of CMakeLists.txt."""
    return CMAKE.format(name=name)
