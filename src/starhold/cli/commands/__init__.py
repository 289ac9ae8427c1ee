"""The commands of the command line; each file of this folder has functions, or groups of them, by name in its `COMMANDS`."""

from importlib import import_module
from pkgutil import iter_modules
from typing import Any

FIRST = ("flying", "campaign", "proofs", "studies", "reproduce", "export", "serve", "studio", "parts", "files")
"""The order in which the files' commands are listed; those of other files follow."""


def every() -> dict[str, Any]:
    """Return all commands by name."""
    others = {item.name for item in iter_modules(__path__)}.difference(FIRST)
    modules = [import_module(f"{__name__}.{name}") for name in (*FIRST, *sorted(others))]
    return {name: command for module in modules for name, command in module.COMMANDS.items()}
