"""A check, which raises an InputError or a ValueError where it refuses numbers, becomes a program that tells which refusal
holds: every way through its comparisons is recorded."""

from collections.abc import Callable
from functools import reduce
from typing import Any

from starhold.algebra.scalar import both, opposite, where
from starhold.algebra.structure import leaves
from starhold.errors import InputError
from starhold.trace.calling import record_call
from starhold.trace.handles import Handle, RecordingError
from starhold.trace.program import Program
from starhold.trace.recording import MARK, Path

MOST = 100
"""Ways through a check."""

Words = list[str | tuple[int, str]]
"""The text of a refusal: pieces of text, and numbers as their place among those of the program and their format."""


def record_check(check: Callable[..., Any], like: tuple[Any, ...]) -> tuple[Program, list[tuple[int, Words]]] | None:
    """Return a program of the floats of the arguments, as of `record_call`, and for each refusal the place of the number
    that is 1 where it holds, with its text; None where the check refuses nothing on account of them. RecordingError where
    the check does what cannot be recorded."""
    refusals: list[tuple[int, Words]] = []

    def ways(*values: Any) -> tuple[Any, ...]:
        refusals.clear()
        recorder = next(leaf.recorder for leaf in leaves(values) if isinstance(leaf, Handle))
        numbers: list[Any] = []
        left, count = [list[bool]()], 0
        while left:
            turns, count = left.pop(), count + 1
            if count > MOST:
                raise RecordingError("", "", f"more than {MOST} ways through a check", "fewer comparisons")
            recorder.path = path = Path(turns)
            try:
                check(*values)
                refusal = None
            except RecordingError:
                raise
            except (InputError, ValueError) as error:
                refusal = str(error)
            except (TypeError, AttributeError) as error:
                raise RecordingError("", "", str(error), "the scalar operations") from None
            finally:
                recorder.path = None
            left += [[*path.taken[:place], True] for place in range(len(turns), len(path.taken))]
            if refusal is None:
                continue
            met = zip(path.truths, path.taken, strict=True)
            holds = reduce(both, (truth if taken else opposite(truth) for truth, taken in met), True)
            first = len(numbers) + 1
            refusals.append((len(numbers), _words(refusal, first)))
            numbers += [where(holds, 1.0, 0.0), *path.numbers]
        return tuple(numbers)

    program, _ = record_call(ways, like)
    return (program, refusals) if refusals else None


def _words(text: str, first: int) -> Words:
    """Return the pieces of a text whose numbers lie from `first` on."""
    pieces: Words = []
    for turn, piece in enumerate(text.split(MARK)):
        if turn % 2:
            place, _, spec = piece.partition(":")
            pieces.append((first + int(place), spec))
        elif piece:
            pieces.append(piece)
    return pieces
