"""The texts of a law in C: header and source."""

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from starhold.algebra.operations import NUMBER
from starhold.algebra.structure import buffers
from starhold.certification.assumptions import texts as assumption_texts
from starhold.certification.certificate import FILE, Certificate
from starhold.certification.wording import HEADINGS, evidence, recheck, sentence, unclaimed
from starhold.export.code import Code
from starhold.export.types import Member, Type, comment
from starhold.laws.program import law_digest
from starhold.parts.contract import fields
from starhold.trace.c99 import GUARD, helpers
from starhold.trace.source import TIE
from starhold.version import __version__


class Proof(NamedTuple):
    """The certificate's file and its digest (both empty for none), its outcome, a line for each claim, the assumptions,
    warnings for readers (empty if all is proved), and the command to check it again."""

    file: str
    digest: str
    outcome: str
    claims: tuple[str, ...]
    assumptions: tuple[str, ...]
    warning: str
    recheck: str = ""


UNPROVED = Proof("", "", "", (), (), "NO CERTIFICATE. Nothing was proved about this law, because no proof was requested.")


def proof_of(certificates: Sequence[Certificate], digest: str) -> Proof:
    """Return the summary of the certificates of one law; digest: the hexadecimal digest of their file."""
    claims: list[str] = []
    wrong: list[str] = []
    assumed: dict[str, None] = {}
    for certificate in certificates:
        if not certificate.claims:
            wrong.append(f"NOTHING IS CLAIMED: {unclaimed(certificate.subject)}.")
        for claim in certificate.claims:
            whose = f"{certificate.name}: " if len(certificates) > 1 else ""
            text = f"{whose}{HEADINGS[claim.kind]}: {sentence(claim, certificate.subject)}"
            claims.append(f"{claim.outcome}: {text}")
            assumed |= dict.fromkeys(assumption_texts(claim.assumptions))
            if claim.outcome != "proved":
                refutation = claim.refutation()
                why = f" ({evidence(refutation)})" if refutation is not None else ""
                wrong.append(f"{'REFUTED' if claim.outcome == 'refuted' else 'NOT DECIDED'}: {text}{why}.")
    outcomes = {certificate.outcome for certificate in certificates}
    outcome = next((one for one in ("refuted", "undecided") if one in outcomes), "proved")
    if outcome != "proved" and not wrong:
        wrong.append("NOT DECIDED: no ultimate bound is claimed.")
    return Proof(FILE, digest, outcome, tuple(claims), tuple(assumed), "\n".join(wrong), recheck(certificates))


WIDTH = 110


class Text(NamedTuple):
    """The files of a law by name."""

    header: str
    source: str


def texts(code: Code, scenario: str, law: str, proof: Proof = UNPROVED) -> Text:
    """Return header and source. scenario, law: the names of the scenario and of its law."""
    types = _spoken_of(code, _interface(code))
    public = {kind.name: f"{code.name}_{kind.name.removeprefix('flight_')}" for kind in types}
    return Text(_header(code, types, public, scenario, law, proof), _source(code, public))


def _interface(code: Code) -> str:
    """Return the names of the types of the step's arguments and results."""
    kinds = code.given["state"], code.given["input"], code.command
    return " ".join(kind.name for kind in kinds if kind is not None)


def _spoken_of(code: Code, text: str) -> list[Type]:
    """Return the types that occur in a text, those of members first."""
    types: list[Type] = []
    for kind in reversed(code.types.known.values()):
        if re.search(rf"\b{kind.name}\b", text):
            types.insert(0, kind)
            text += "".join(f" {member.type.name}" for member in kind.members)
    return types


def _header(code: Code, types: list[Type], public: dict[str, str], scenario: str, law: str, proof: Proof) -> str:
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
    for kind in types:
        if kind.name != STATE.name:
            lines += [*_declaration(kind, public), ""]
    lines += [*_state(code, public), ""]
    lines += comment(
        "Sets the state to that of the scenario's start"
        + (": the side of the quaternion is that of its initial attitude." if "sign" in code.flight.start._fields else ".")
    )
    lines += [f"void {name}_init({name}_state_t *state);", ""]
    more = " and memcpy" if helpers("\n".join(code.printed.lines)) else ""
    lines += comment(
        f"One control step: {card.summary}. Takes what was measured at this instant, gives what to command until the next, "
        f"and changes the state. It calls nothing but sqrt{more} and keeps nothing outside the state. It does not check "
        "what it is given: a NaN that the law uses comes out as one."
    )
    lines += [f"void {name}_step({name}_state_t *state, const {name}_input_t *input, {name}_command_t *command);", ""]
    lines += ["#ifdef __cplusplus", "}", "#endif", "", f"#endif /* {guard} */", ""]
    return "\n".join(lines)


STATE = Type("flight_state_t", "", named=True)


def _state(code: Code, public: dict[str, str]) -> Iterator[str]:
    """Yield the lines of the state's declaration."""
    if code.flight.start._fields:
        yield from comment("The memory from step to step: set it by the function below, and do not change it.")
        kind = code.given["state"] or STATE
        yield from _declaration(kind, {**public, STATE.name: f"{code.name}_state_t"}, code.buffers)
    else:
        yield from comment("The law has no memory. C has no empty structs.")
        yield from ("typedef struct {", "    double unused;", f"}} {code.name}_state_t;")


def _banner(code: Code, scenario: str, law: str, proof: Proof) -> list[str]:
    loop = code.flight.loop
    card, work = loop.law.card, code.work
    lines = [
        f"{code.name}: {card.title}",
        "",
        f"{card.summary}",
        "",
        f"Made by starhold {__version__} from the scenario {scenario}, law {law}.",
    ]
    lines += [f"Source: {source}" for source in card.sources]
    lines += [f"Assumes: {'; '.join(card.assumptions)}.", ""]
    lines += [f"Command limit: {_limit(loop)}. Quaternion sign: {loop.sign_policy.replace('_', ' ')}."]
    lines += _choices(loop)
    done = f"{work.arithmetic} additions, multiplications, divisions and roots, and {work.comparisons} comparisons"
    lines += ["", f"A step does at most {done}.",
              "Bits are those of the simulation where doubles are IEEE and nothing is contracted or reassociated:",
              "compile with -std=c99 -ffp-contract=off, never with -ffast-math."]  # fmt: skip
    program = law_digest(loop.law, loop.gains, loop.known, loop.period)
    lines += ["", *([f"Program of the law: sha256 {program}"] if program else [])]
    if proof.warning:
        lines += ["*" * 100, *(f"WARNING  {line}" for line in proof.warning.splitlines()), "*" * 100]
    if proof.file:
        lines += ["", f"Certificate: {proof.file}, sha256 {proof.digest}: {proof.outcome}", "Claims:"]
        lines += [f"  {line}" for line in proof.claims]
        lines += [f"These claims assume: {'; '.join(proof.assumptions)}."] if proof.assumptions else []
        lines += [f"Check it independently: {proof.recheck}"]
    return comment("\n".join(lines))


def _limit(loop: Any) -> str:
    unit = {"torque": "N m"}.get(loop.body.module.COMMAND, "")
    return (
        "none"
        if loop.limit == "none"
        else f"{loop.saturation_limit():.12g} {unit} by {loop.limit}".replace(" by axis", " on each axis").replace(
            "by norm", "in norm"
        )
    )


def _choices(loop: Any) -> list[str]:
    """Return the comment on the gains that are constants of this code."""
    pairs = zip(fields(type(loop.gains)), loop.gains, strict=True)
    choices = [f"{item.name} = {item.written(value)}" for item, value in pairs if item.gain.choices or item.gain.whole]
    return [f"Fixed in this code: {', '.join(choices)}."] if choices else []


def _source(code: Code, public: dict[str, str]) -> str:
    name, printed = code.name, code.printed
    banner = f"{name}.c: made by starhold {__version__}; see {name}.h. Do not edit: change the scenario and export it again."
    lines = [*comment(banner), "", f'#include "{name}.h"', ""]
    constants = list(_constants(code))
    body = "\n".join([*constants, *printed.lines])
    needed = {"math": r"\bsqrt\(|\bINFINITY\b|\bNAN\b", "stdbool": r"\bbool\b", "stdint": r"\bint32_t\b|\bUINT64_C\b"}
    includes = [f"#include <{file}.h>" for file, words in needed.items() if re.search(words, body)]
    taking = helpers(body)
    includes += ["#include <string.h>"] * bool(taking)
    includes += ["#include <stdint.h>"] if code.buffers and "#include <stdint.h>" not in includes else []
    lines += [*includes, *([""] if includes else []), GUARD, ""]
    aliases = [f"typedef {title} {kind};" for kind, title in public.items() if not kind.startswith("flight_")]
    lines += [*aliases, ""] if aliases else []
    for kind in _spoken_of(code, f"{body} {_interface(code)}"):
        if kind.name not in public:
            lines += [*_declaration(kind, {}), ""]
    for text in taking:
        lines += [*text.splitlines(), ""]
    lines += [*constants, ""] if constants else []
    for memory, parts in code.parts.items():
        lines += [*comment(f"Where the parts of {memory} begin."), "enum {"]
        lines += [f"    {part.upper()}_AT = {first}," for first, part in sorted(parts.items())]
        lines += ["};"]
    module = ""
    for function in printed.functions.values():
        if not printed.is_main(function):
            if function.shape.module != module:
                module = function.shape.module
                lines += ["", _rule(module.removeprefix("starhold."))]
            lines += printed.chunks[function.name]
    lines += ["", _rule("interface"), "", *_init(code), ""]
    lines += [f"void {name}_step({name}_state_t *state, const {name}_input_t *input, {name}_command_t *command)", "{"]
    chunk = printed.chunks[code.program.main.name]
    if not any(re.search(r"\bstate\b", line) for line in chunk) and not code.buffers:
        lines += ["    (void)state;"]
    lines += [f"    double *const {memory} = state->{memory};" for memory in code.buffers]
    return "\n".join([*lines, *chunk, "}", ""])


def _rule(title: str) -> str:
    return f"/* {f' {title} '.center(88, '-')} */"


def _declaration(kind: Type, public: dict[str, str], arrays: Mapping[str, int] = MappingProxyType({})) -> Iterator[str]:
    """Yield the lines of a struct; public: names of types in the header; arrays: names and sizes of further members."""
    yield from comment(kind.text)
    yield "typedef struct {"
    members = kind.members
    first = public.get(members[0].type.name, members[0].type.name) if members else ""
    if kind.elements:
        yield f"    {first} {kind.elements}[{len(members)}];"
    elif members and not kind.named and all(member.type == members[0].type for member in members):
        yield f"    {first} {', '.join(member.name for member in members)};"
    else:
        for member in members:
            yield from _member(member, public)
    for name, size in arrays.items():
        yield f"    double {name}[{size}];"
    yield f"}} {public.get(kind.name, kind.name)};"


def _member(member: Member, public: dict[str, str]) -> Iterator[str]:
    line = f"    {public.get(member.type.name, member.type.name)} {member.name};"
    note = f" /* {member.text.replace('*/', '* /')} */" if member.text else ""
    if len(line + note) > WIDTH:
        yield from ("    " + part for part in comment(member.text))
        yield line
    else:
        yield line + note


def _constants(code: Code) -> Iterator[str]:
    """Yield the lines of the constant parameters."""
    if (kind := code.given["parameters"]) is not None:
        yield "static const parameters_t parameters = {"
        yield from _fields(code, kind, code.flight.parameters, "    ")
        yield "};"


def _fields(code: Code, kind: Type, value: Any, indent: str) -> Iterator[str]:
    for member, part in code.types.members(kind, value):
        if member.type.named:
            yield f"{indent}.{member.name} = {{"
            yield from _fields(code, member.type, part, indent + "    ")
            yield f"{indent}}},"
        else:
            note = f" /* {member.text.partition(':')[0]} */" if ":" in member.text else ""
            yield f"{indent}.{member.name} = {_literal(code, member.type, part)},{note}".replace(TIE, " ")


def _literal(code: Code, kind: Type, value: Any) -> str:
    """Return the C text of a constant value."""
    if not kind.members:
        return code.printed.text(code.types.within(value), NUMBER)
    return kind.braced([_literal(code, member.type, part) for member, part in code.types.members(kind, value)])


def _init(code: Code) -> Iterator[str]:
    """Yield the lines that set the initial state."""
    name, printed, start = code.name, code.printed, code.flight.start
    firsts = {memory: _trimmed(one.row(0, one.size)) for memory, one in zip(code.buffers, buffers(start), strict=True)}
    for memory, first in firsts.items():
        if first:
            yield f"/* What {memory} begin with; the rest are zeros. */"
            yield f"static const double first_{memory}[{len(first)}] = {{"
            text = ", ".join(printed.text(number, NUMBER) for number in first)
            yield from textwrap.wrap(text, WIDTH, initial_indent="    ", subsequent_indent="    ")
            yield from ("};", "")
    yield f"void {name}_init({name}_state_t *state)"
    yield "{"
    if not start._fields:
        yield "    state->unused = 0.0;"
    for member, part in code.types.members(code.given["state"], start):
        cast = f"({member.type.name})" if member.type.members else ""
        yield f"    state->{member.name} = {cast}{_literal(code, member.type, part)};".replace(TIE, " ")
    for memory, first in firsts.items():
        value = f"k < {len(first)} ? first_{memory}[k] : 0.0" if first else "0.0"
        yield f"    for (int32_t k = 0; k < {code.buffers[memory]}; k++) {{"
        yield f"        state->{memory}[k] = {value};"
        yield "    }"
    yield "}"


def _trimmed(values: tuple[float, ...]) -> tuple[float, ...]:
    """Return numbers without the zeros at their end."""
    while values and str(values[-1]) == "0.0":
        values = values[:-1]
    return values
