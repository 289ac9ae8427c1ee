"""The bodies of scenarios. Each module or folder here defines the tables of one body, and no other code names it;
`any_body` defines the tables of all other bodies."""

import pkgutil
from collections.abc import Mapping
from difflib import get_close_matches
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from starhold.errors import InputError
from starhold.laws.catalogue import Law
from starhold.parts.catalogue import find, parts
from starhold.scenario.bodies.interface import Body


@cache
def bodies() -> dict[str, Body]:
    """Return the bodies by name: the `BODY` of every module of this package that has one."""
    modules = [import_module(f"{__name__}.{item.name}") for item in pkgutil.iter_modules(__path__)]
    all_bodies: list[Body] = [module.BODY for module in modules if hasattr(module, "BODY")]
    return {body.name: body for body in all_bodies}


def body_of(tables: Mapping[str, Any], where: str, folder: Path) -> Body:
    """Return the body whose marker table is in the file. InputError if there is none, or more than one."""
    markers = {body.marker: body for body in (_any_body().NAMED_BY_TABLE, *bodies().values())}
    there = [marker for marker in markers if marker in tables]
    if len(there) > 1:
        raise InputError(where, there[1], f"a second body beside [{there[0]}]", "one of the two")
    if there:
        return markers[there[0]].chosen(tables, where, folder)
    for key in tables:
        # Stricter than `nearest`, which takes [simulation] for a misspelt [libration].
        if near := get_close_matches(key[:100], markers, n=1, cutoff=0.8):
            raise InputError(where, key, "an unknown key", f"did you mean {near[0]}?")
    raise InputError(where, "", "no body", f"one of the tables {', '.join(f'[{marker}]' for marker in sorted(markers))}")


def body_for(law: Law) -> Body:
    """Return the body that a law controls."""
    return bodies().get(law.body) or _any_body().AnyBody(find("body", law.body))


def others() -> list[Body]:
    """Return the bodies without tables of their own: each installed one, and one that stands for all bodies in files."""
    return [
        _any_body().NAMED_BY_TABLE,
        *(_any_body().AnyBody(part) for name, part in parts("body").items() if name not in bodies()),
    ]


def _any_body() -> Any:
    # Imported here, because its tables come from `schema`, which looks up all bodies in this module.
    return import_module(f"{__name__}.any_body")
