"""Errors that a user can cause. Each is one line; the command line ends with exit code 2 on it."""

from __future__ import annotations

import signal
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

_Function = TypeVar("_Function", bound=Callable[..., Any])


class InterruptedByUserError(BaseException):
    """Ctrl-C or a request to end, under a name that the command-line library does not turn into an exit code of its own."""


def is_interrupt(error: BaseException) -> bool:
    """Whether an error is the user's wish to end, and no fault of the file in which it was raised. A command has a handler
    of its own for Ctrl-C, so that a `KeyboardInterrupt` there is the file's."""
    plain = isinstance(error, KeyboardInterrupt) and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    return plain or isinstance(error, InterruptedByUserError)


class InputError(Exception):
    """Something the user wrote is not as it must be: where (file and key), what was found, what is allowed."""

    def __init__(self, where: str, key: str, found: str, allowed: str) -> None:
        self.where, self.key, self.found, self.allowed = where, key, found, allowed
        parts = [where, key, f"found {found}" if found else ""]
        # Without something found, `allowed` is a sentence of its own.
        bare = not found or allowed.startswith("did you mean")
        hint = allowed if bare else f"allowed: {allowed}"
        joint = "; " if found else ": "
        super().__init__(_one_line(": ".join(part for part in parts if part) + (f"{joint}{hint}" if allowed else "")))


def shortly(function: _Function) -> _Function:
    """A function of the Python interface: its InputError says where the fault is, so that the frames below add nothing."""

    @wraps(function)
    def called(*args: Any, **keywords: Any) -> Any:
        try:
            return function(*args, **keywords)
        except InputError as error:
            raise error.with_traceback(None) from None

    return cast(_Function, called)


def _one_line(text: str) -> str:
    """A character that does not print, such as a line break in a key, as its escape."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
