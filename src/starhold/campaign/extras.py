"""Packages that only campaigns need, imported when they are used."""

from importlib import import_module
from typing import Any

from starhold.errors import InputError


def extra(name: str) -> Any:
    """The module of this name; InputError, with the command that installs it, where its package is missing."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        # A module missing from inside a package that is installed is another matter.
        if error.name is None or error.name.partition(".")[0] != name.partition(".")[0]:
            raise
        package = name.partition(".")[0]
        raise InputError("campaigns", "", "", f"need {package}: pip install 'starhold[campaign]'") from None
