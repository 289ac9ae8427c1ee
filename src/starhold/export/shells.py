"""Shells around the exported C, and their build files: templates filled with the names and numbers of a law."""

import io
import re
import uuid
import zipfile
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from starhold import files
from starhold.errors import InputError
from starhold.export.code import Code
from starhold.export.law import numbers
from starhold.export.source import texts
from starhold.export.vectors import kept_inputs
from starhold.link.header import HEADER, header
from starhold.link.layout import Layout
from starhold.parts.contract import CLOCK
from starhold.version import __version__

SOURCES = {
    "attitude": ("attitude", "self._quaternion(read.sigma_BN)"),
    "rate": ("attitude", "read.omega_BN_B"),
    "position": ("translation", "read.r_BN_N"),
    "velocity": ("translation", "read.v_BN_N"),
}
"""Inputs of laws: the Basilisk message that contains each, and its field."""


def filled(template: str, code: Code, **more: Any) -> dict[str, str]:
    """Return the files of a template by path, with each @KEY@ replaced; a line ==> begins a file and gives its path."""
    inputs, outputs = variables(code)
    period, kept = code.flight.loop.period, len(numbers(code.flight.start))
    values = {
        "NAME": code.name,
        "UPPER": code.name.upper(),
        "CLASS": "".join(word.capitalize() for word in code.name.split("_")),
        "TITLE": code.flight.loop.law.card.title,
        "PERIOD": repr(period),
        "PERIOD_G": f"{period:g}",
        "INPUTS": len(inputs),
        "OUTPUTS": len(outputs),
        "GIVEN": ", ".join(inputs),
        "TOLD": ", ".join(outputs),
        "STATE": kept or 1,
        "STATES": kept,
        **more,
    }
    parts = re.split(r"^==> (.*)\n", files.filled("starhold.export", template, values), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def variables(code: Code) -> tuple[list[str], list[str]]:
    """Return the names of the inputs, and those of the command."""
    inputs = [name.replace(".e[", "[") for member in code.inputs for name in member.type.leaves(member.name)]
    return inputs, [name.removeprefix(".") for name in code.command.leaves()]


def _basilisk(code: Code) -> dict[str, str]:
    """Return a law as a module of Basilisk. Raise InputError for inputs that no message of Basilisk contains."""
    wanted = [member.name for member in code.inputs]
    for name in wanted:
        if name not in SOURCES:
            raise InputError(
                "export basilisk", "", f"the input {name}", f"inputs that messages contain: {', '.join(SOURCES)}"
            )
    reads: list[str] = []
    for message in ("attitude", "translation"):
        fields = [name for name in wanted if SOURCES[name][0] == message]
        if fields:
            reads += [f"        read = self.{message}InMsg()", *(f"        {name} = {SOURCES[name][1]}" for name in fields)]
    return filled("basilisk", code, READS="\n".join(reads), GIVEN=", ".join(f"*{name}" for name in wanted))


def _fmu(code: Code) -> dict[str, bytes]:
    """Return a law as an FMU for co-simulation, FMI 3.0: an archive of sources.

    The standard requires a binary to have every function of its interface; those that a sampled law does not need return an
    error."""
    inputs, outputs = variables(code)
    taken, given = 'causality="input" start="0.0"', 'causality="output" variability="discrete"'
    # In the standard `time` is the variable of simulation time.
    called = ["time_since_start" if name == CLOCK else name for name in inputs]
    roles = [*((name, taken) for name in called), *((name, given) for name in outputs)]
    listed = [f'    <Float64 name="{name}" valueReference="{k}" {role}/>' for k, (name, role) in enumerate(roles, 1)]
    text = texts(code, "", code.flight.loop.law.name)
    ends = [(kind, k) for kind in ("Output", "InitialUnknown") for k in range(1 + len(inputs), 1 + len(roles))]
    made = filled(
        "fmu",
        code,
        VERSION=__version__,
        # Changes with the code.
        TOKEN=uuid.uuid5(uuid.NAMESPACE_URL, text.header + text.source),
        VARIABLES="\n".join(listed),
        STRUCTURE="\n".join(f'    <{kind} valueReference="{k}"/>' for kind, k in ends),
    )
    made["sources/fmi.c"] = re.sub(r"^@REFUSED@ (\S+)\((.*)\)(.*)$", _refused, made["sources/fmi.c"], flags=re.MULTILINE)
    made |= {f"sources/{code.name}.c": text.source, f"sources/{code.name}.h": text.header}
    archived = io.BytesIO()
    with zipfile.ZipFile(archived, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in made.items():
            # A fixed date, so that the bytes are always the same.
            archive.writestr(zipfile.ZipInfo(name, (2000, 1, 1, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)
    return {f"{code.name}.fmu": archived.getvalue()}


def _process(code: Code) -> dict[str, str]:
    """Return a law as a process that commands the plant of its scenario by messages of `starhold.link`."""
    loop, layout = code.flight.loop, Layout(code.flight.loop)
    acting = [f"effectors.{one.called}" for one in loop.used("effector") if one.part.flag("ACTS")]
    places: list[int] = []
    for name, value in code.flight.inputs._asdict().items():
        # As in the simulation, the last sensor of a quantity is used.
        known = [f"sensors.{one.called}.{name}" for one in reversed(loop.used("sensor"))]
        known += {"target": ["target"], "wheels": acting[:1], CLOCK: [f"measurement.{CLOCK}"]}.get(name, [f"state.{name}"])
        begin = next(one.first for wanted in known for one in layout.fields if f"{one.name}.".startswith(f"{wanted}."))
        places += range(1 + begin, 1 + begin + len(numbers(value)))
    rows = [f"    {places[kept]}" for kept in kept_inputs(code)] or ["    0"]
    made = filled("process", code, PLACES=",\n".join(rows), PLACED=len(rows))
    return made | {HEADER: header(loop, loop.law.name)}


def _refused(match: re.Match[str]) -> str:
    """Return functions of FMI 3.0 that return an error: one, or one for each of some words in place of ~."""
    words = [param.replace("[]", "").split()[-1].lstrip("*") for param in match[2].split(",")]
    unused = " ".join(f"(void){word};" for word in words)
    text = f"FMI3_Export fmi3Status {match[1]}({match[2]})\n{{\n    {unused}\n    return fmi3Error;\n}}"
    return "\n".join(text.replace("~", word) for word in match[3].split() or [""])


SHELLS: dict[str, Callable[[Code], Mapping[str, str | bytes]]] = {
    "basilisk": _basilisk,
    "fmu": _fmu,
    "cfs": lambda code: filled("cfs", code),
    "fprime": lambda code: filled("fprime", code),
    "process": _process,
}
"""Functions that make the files of a shell, by its name."""


def shell_files(code: Code, shells: Iterable[str]) -> dict[str, str | bytes]:
    """Return the files of shells. Raise InputError for an unknown shell, or a law that does not fit."""
    made: dict[str, str | bytes] = {}
    for shell in shells:
        if shell not in SHELLS:
            raise InputError("export c", "shell", shell, f"one of {', '.join(SHELLS)}")
        made |= SHELLS[shell](code)
    return made
