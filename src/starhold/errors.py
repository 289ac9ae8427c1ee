"""Errors that a user can cause: one line of text, and exit code 2 of the command line."""

import signal
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from functools import wraps
from importlib import import_module
from typing import Any, TypeVar, cast

_Function = TypeVar("_Function", bound=Callable[..., Any])


class InterruptedByUserError(BaseException):
    """Ctrl-C or a request to end, under a name that the command-line library does not turn into an exit code of its own."""


def is_interrupt(error: BaseException) -> bool:
    """Whether an error is the user's request to stop, rather than an error of the user's file that was running. Commands
    handle Ctrl-C themselves, so a `KeyboardInterrupt` in them was raised by the file."""
    plain = isinstance(error, KeyboardInterrupt) and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    return plain or isinstance(error, InterruptedByUserError)


class InputError(Exception):
    """A user's input is wrong: where (file and key), the value given and the values allowed."""

    def __init__(self, where: str, key: str, given: str, allowed: str) -> None:
        self.where, self.key, self.given, self.allowed = where, key, given, allowed
        parts = [where, key, f"found {given}" if given else ""]
        # Where nothing is given, `allowed` is a sentence of its own.
        bare = not given or allowed.startswith("did you mean")
        hint = allowed if bare else f"allowed: {allowed}"
        joint = "; " if given else ": "
        super().__init__(_one_line(": ".join(part for part in parts if part) + (f"{joint}{hint}" if allowed else "")))

    def __reduce__(self) -> tuple[Any, ...]:
        return InputError, (self.where, self.key, self.given, self.allowed)


class CutShortError(InputError):
    """A flight ended early for a reason outside the simulation, such as a law's process that failed; recording: the flight
    until then, None if there is nothing of it."""

    recording: Any = None


def expect(value: Any, kinds: Any, where: str, allowed: str) -> None:
    """Raise InputError where an argument of the Python interface is of none of these types."""
    if not isinstance(value, kinds):
        given = repr(value)[:60] if isinstance(value, str | int | float | None) else f"a {type(value).__name__}"
        raise InputError(where, "", given.replace("'", '"'), allowed)


@contextmanager
def input_at(where: str, key: str, given: str = "") -> Generator[None]:
    """Inside this context, turn a ValueError into an InputError about this key."""
    try:
        yield
    except ValueError as error:
        raise InputError(where, key, given, str(error)) from None


def shortly(function: _Function) -> _Function:
    """Decorate a function of the Python interface: the traceback of its InputError ends at the caller."""

    @wraps(function)
    def called(*args: Any, **keywords: Any) -> Any:
        try:
            return function(*args, **keywords)
        except InputError as error:
            raise error.with_traceback(None) from None

    return cast(_Function, called)


def closest(word: str, known: Sequence[str]) -> str:
    """Return a hint for an unknown word: the nearest known one, else all of them."""
    # Imported here, because most commands do without.
    from difflib import get_close_matches

    near = get_close_matches(word[:100], known, n=1, cutoff=0.6)
    return f"did you mean {near[0]}?" if near else f"one of {', '.join(known)}"


def optional(name: str, user: str, bundle: str) -> Any:
    """Return the module of this name. InputError, which names the extra to install, if its package is missing. user: what
    needs the package, such as a command; bundle: the extra."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        # A module missing inside an installed package is an error of that package.
        if error.name is None or error.name.partition(".")[0] != name.partition(".")[0]:
            raise
        package = name.partition(".")[0]
        raise InputError(user, "", "", f"need {package}: pip install 'starhold[{bundle}]'") from None


def _one_line(text: str) -> str:
    """Return the text with characters that do not print, such as line breaks, as their escapes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
