"""The protocol as a C header, for the readings of one loop."""

import re
import textwrap

from starhold.files import filled
from starhold.link.layout import Layout
from starhold.link.protocol import COMMANDS, HEAD, MAGIC, RULES, TAIL, VERSION, Kind
from starhold.loop.closed_loop import ClosedLoop
from starhold.version import __version__

HEADER = "starhold_link.h"


def place_name(field: str) -> str:
    """Return the C name of the offset of a field."""
    return "STARHOLD_AT_" + re.sub(r"\W", "_", field).upper()


def header(loop: ClosedLoop, scenario: str) -> str:
    """Return the text of the header; scenario: its name."""
    layout = Layout(loop)
    places = [("time", 0, 1), *((one.name, 1 + one.first, one.size) for one in layout.fields)]
    kinds = [f"{kind.name.lower()}: {_about(kind)}" for kind in Kind]
    values = {
        "VERSION": __version__,
        "SCENARIO": re.sub(r"[^\w .,:-]", " ", scenario),
        "MAGIC": MAGIC.decode(),
        "PROTOCOL": VERSION,
        "HEAD": HEAD.size,
        "TAIL": TAIL.size,
        "COMMANDS": COMMANDS,
        "KINDS": "\n".join(textwrap.fill(one, 110, initial_indent="   ", subsequent_indent="       ") for one in kinds),
        "ENUM": ",\n".join(f"    STARHOLD_{kind.name} = {kind.value}" for kind in Kind),
        "NUMBERS": 1 + layout.size,
        "LAYOUT": f"0x{layout.check:08X}",
        "PERIOD": repr(loop.period),
        "UNIT": getattr(loop.body.module, "TIME_UNIT", "s"),
        "PLACES": ",\n".join(f"    {place_name(name)} = {first} /* {size} */" for name, first, size in places),
    }
    return filled("starhold.link", "starhold_link", values)


def _about(kind: Kind) -> str:
    rule = RULES[kind]
    said = [f"{who} {does}" for who, does in (("flight software", rule.software), ("the plant", rule.plant)) if does]
    return f"{'; '.join(said)}. Numbers: {rule.numbers}."
