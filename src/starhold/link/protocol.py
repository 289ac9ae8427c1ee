"""The protocol between a plant and flight software: messages in binary form and as lines of JSON."""

from __future__ import annotations

import json
import math
import struct
import zlib
from collections.abc import Iterator, Sequence
from enum import IntEnum, StrEnum
from typing import Any, NamedTuple, cast

MAGIC, VERSION = b"SHLK", 1
HEAD, TAIL = struct.Struct("<4sBBHII"), struct.Struct("<I")
"""Magic, version, kind, zero, payload length in bytes, step; and the CRC-32 of everything before it."""
KEYS = {"kind", "version", "step", "numbers", "text", "about"}
"""Keys of a line of JSON."""
LINE = 2**16
"""Most bytes in a line of JSON."""
STEPS = 2**32
COMMANDS = 3
"""Number of components of a command."""


class Kind(IntEnum):
    """The kinds of messages, with their numbers in the binary form."""

    HELLO = 1
    READINGS = 2
    COMMAND = 3
    RESET = 4
    STOP = 5
    REFUSED = 6


class Rule(NamedTuple):
    """A kind of message: its meaning from flight software and from the plant (empty if the plant does not send it), how
    many numbers flight software may send, and what they are."""

    software: str
    plant: str
    counts: tuple[int, ...]
    numbers: str


RULES = {
    Kind.HELLO: Rule(
        "asks for the plant's description; may be sent at any time",
        "answers, and readings follow",
        (0,),
        "of the plant: control period (s), how many numbers readings have, CRC-32 of their layout; then JSON",
    ),
    Kind.READINGS: Rule("", "gives the readings at a step's instant", (), "time (s), then the fields that hello lists"),
    Kind.COMMAND: Rule(
        "commands for the period that begins with the step", "", (COMMANDS,), "three, in the body's unit (N m)"
    ),
    Kind.RESET: Rule("begins the flight again; readings of step 0 follow", "", (0, 2), "none, or seed and run"),
    Kind.STOP: Rule("ends the flight", "ends the flight; the text says why", (0,), "none"),
    Kind.REFUSED: Rule("", "rejects a message; the text says why", (), "none"),
}
"""The rule of every kind of message."""


class Fault(StrEnum):
    """The faults for which a message is rejected."""

    MALFORMED = "malformed"
    VERSION = "of another version"
    NOT_FINITE = "not finite"
    LATE = "late"
    DOUBLED = "doubled"
    ORDER = "out of order"
    STRANGER = "of a stranger"


class Message(NamedTuple):
    """One message of either form."""

    kind: Kind
    step: int = 0
    numbers: Sequence[float] = ()
    text: str = ""


def binary(message: Message) -> bytes:
    """Return the message as a frame: head, numbers as little-endian doubles, text in UTF-8, CRC-32."""
    payload = struct.pack(f"<{len(message.numbers)}d", *message.numbers) + message.text.encode()
    framed = HEAD.pack(MAGIC, VERSION, message.kind, 0, len(payload), message.step) + payload
    return framed + TAIL.pack(zlib.crc32(framed))


def line(message: Message) -> bytes:
    """Return the message as a line of JSON, in which a number that is not finite is null."""
    content: dict[str, Any] = {"kind": message.kind.name.lower(), "version": VERSION, "step": message.step}
    if len(message.numbers):
        content["numbers"] = [x if math.isfinite(x) else None for x in map(float, message.numbers)]
    if message.text:
        hello = message.kind is Kind.HELLO
        content |= {"about": json.loads(message.text)} if hello else {"text": message.text}
    return json.dumps(content, allow_nan=False).encode() + b"\n"


class Decoder:
    """Decodes messages from the bytes received, in pieces of any size. The first byte gives the form: `{` begins lines of
    JSON.

    An invalid message yields a fault, after which the decoder continues with the next line, or the next complete frame.
    by_plant: the messages come from a plant, else from flight software, whose numbers are checked."""

    def __init__(self, by_plant: bool = False) -> None:
        self.by_plant = by_plant
        self.is_text: bool | None = None
        self._held = bytearray()
        self._skipping = False

    def feed(self, data: bytes) -> Iterator[Message | Fault]:
        """Yield the messages and faults completed by these bytes."""
        self._held += data
        if self.is_text is None and self._held:
            self.is_text = self._held.startswith(b"{")
        yield from self._lines() if self.is_text else self._frames()

    def end(self) -> Iterator[Fault]:
        """Yield a fault if the bytes end within a message."""
        if self._held and not self._skipping:
            yield Fault.MALFORMED
        self._held.clear()

    def _lines(self) -> Iterator[Message | Fault]:
        while (end := self._held.find(b"\n")) >= 0:
            text, skipped = bytes(self._held[:end]), self._skipping
            del self._held[: end + 1]
            self._skipping = False
            if text.strip() and not skipped:
                yield self._checked(_of_line(text))
        if len(self._held) > LINE:
            if not self._skipping:
                yield Fault.MALFORMED
            self._skipping = True
            self._held.clear()

    def _frames(self) -> Iterator[Message | Fault]:
        buffer = self._held
        while buffer:
            begin = buffer.find(MAGIC)
            if begin < 0:
                # The beginning of a frame may still be incomplete.
                begin = next(len(buffer) - n for n in range(len(MAGIC) - 1, -1, -1) if buffer.endswith(MAGIC[:n]))
            if begin > 0:
                del buffer[:begin]
                if not self._skipping:
                    yield Fault.MALFORMED
            if len(buffer) >= len(MAGIC):
                self._skipping = False
            elif begin > 0:
                self._skipping = True
            if len(buffer) < HEAD.size:
                return
            _, version, number, zero, size, step = HEAD.unpack_from(buffer)
            end = HEAD.size + size
            fits = version == VERSION and zero == 0 and (size <= LINE if self.by_plant else size in _sizes(number))
            if fits and len(buffer) < end + TAIL.size:
                return
            if not fits or TAIL.unpack_from(buffer, end)[0] != zlib.crc32(buffer[:end]):
                # The next frame may begin within what looked like one.
                del buffer[:1]
                self._skipping = True
                yield Fault.MALFORMED if version == VERSION or zero != 0 else Fault.VERSION
                continue
            payload = bytes(buffer[HEAD.size : end])
            del buffer[: end + TAIL.size]
            yield self._checked(_of_payload(number, step, payload))

    def _checked(self, message: Message | Fault) -> Message | Fault:
        if isinstance(message, Fault) or self.by_plant:
            return message
        if len(message.numbers) not in RULES[message.kind].counts or not RULES[message.kind].software:
            return Fault.MALFORMED
        if not all(map(math.isfinite, message.numbers)):
            return Fault.NOT_FINITE
        if message.kind is Kind.RESET and any(x != int(x) or abs(x) >= 2**53 for x in message.numbers):
            return Fault.MALFORMED
        return message


def _sizes(number: int) -> tuple[int, ...]:
    """Return the allowed payload lengths of a kind of message from flight software; none if it does not send it."""
    rule = RULES.get(cast(Kind, number))
    return () if rule is None or not rule.software else tuple(8 * count for count in rule.counts)


def _of_payload(number: int, step: int, payload: bytes) -> Message | Fault:
    if number not in RULES:
        return Fault.MALFORMED
    kind, count = Kind(number), len(payload) // 8
    if kind in (Kind.STOP, Kind.REFUSED):
        count = 0
    elif kind is Kind.HELLO:
        count = min(count, 3)
    try:
        return Message(kind, step, struct.unpack_from(f"<{count}d", payload), payload[8 * count :].decode())
    except UnicodeDecodeError:
        return Fault.MALFORMED


def _of_line(text: bytes) -> Message | Fault:
    try:
        given: Any = json.loads(text)
        if not isinstance(given, dict):
            return Fault.MALFORMED
        content = cast("dict[str, Any]", given)
        version = content.get("version", VERSION)
        if version != VERSION or isinstance(version, bool):
            return Fault.VERSION
        kind, numbers = Kind[content["kind"].upper()], content.get("numbers", [])
        step = content["step"] if kind is Kind.COMMAND else content.get("step", 0)
        known = content["kind"] == kind.name.lower() and content.keys() <= KEYS
        if not known or type(step) is not int or not 0 <= step < STEPS:
            return Fault.MALFORMED
        if not isinstance(numbers, list) or any(type(x) not in (int, float, type(None)) for x in cast("list[Any]", numbers)):
            return Fault.MALFORMED
        about = content.get("about")
        said = content.get("text", "") if about is None else json.dumps(about)
        return Message(kind, step, tuple(map(_number, cast("list[Any]", numbers))), str(said))
    except (ValueError, KeyError, AttributeError, TypeError, RecursionError):
        return Fault.MALFORMED


def _number(given: float | None) -> float:
    """Return a number of JSON; null, and a number too large for a double, is not finite."""
    try:
        return math.nan if given is None else float(given)
    except OverflowError:
        return math.inf
