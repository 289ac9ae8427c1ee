"""Errors that a user can cause. Each is one line; the command line ends with exit code 2 on it."""

from __future__ import annotations


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


def _one_line(text: str) -> str:
    """A character that does not print, such as a line break in a key, as its escape."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
