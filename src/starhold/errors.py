"""Errors that a user can cause. Each is one line; the command line ends with exit code 2 on it."""

from __future__ import annotations


class InputError(Exception):
    """Something the user wrote is not as it must be: where (file and key), what was found, what is allowed."""

    def __init__(self, where: str, key: str, found: str, allowed: str) -> None:
        self.where, self.key, self.found, self.allowed = where, key, found, allowed
        parts = [where, key, f"found {found}" if found else ""]
        hint = allowed if allowed.startswith("did you mean") else f"allowed: {allowed}"
        super().__init__(": ".join(part for part in parts if part) + (f"; {hint}" if allowed else ""))
