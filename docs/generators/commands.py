"""The page of commands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import typer

from generators.tables import table
from starhold.cli import arguments
from starhold.cli.main import app

HEAD = """# Commands

Written from the command line itself by `make docs`. Every command that takes a FILE takes the name of a built-in
scenario (`starhold scenarios`) in its place. What a command writes appears whole or not at all, in a folder that it makes; a
folder that holds results is refused without `--force`.
"""


def page() -> str:
    """Every command with its arguments and options."""
    lines = [HEAD, *exit_codes()]
    for name, command in _commands(typer.main.get_command(app)):
        lines += [f"## starhold {name}", "", " ".join((command.help or "").split()), ""]
        rows = [_row(p) for p in command.params if not p.hidden]
        if rows:
            lines += [table(["argument or option", "meaning", "default"], rows), ""]
    return "\n".join(lines)


def _commands(group: Any, before: str = "") -> Iterator[tuple[str, Any]]:
    """The commands of a group with those of the groups in it, by their full names."""
    for name, command in group.commands.items():
        yield before + name, command
        if hasattr(command, "commands"):
            yield from _commands(command, f"{before}{name} ")


def _row(parameter: Any) -> list[str]:
    argument = parameter.param_type_name == "argument"
    shown = parameter.metavar or parameter.name.upper().replace("_", "-")
    if not argument:
        names = ", ".join(f"`{name}`" for name in (*parameter.opts, *parameter.secondary_opts))
        kind = "" if parameter.is_flag else f" {parameter.metavar or _kind(parameter)}"
        shown = names + kind
    else:
        shown = f"`{shown}`"
    default = "required" if parameter.required else _default(parameter)
    return [shown, parameter.help or "", default]


def _kind(parameter: Any) -> str:
    return {"int": "N", "float": "NUMBER"}.get(parameter.type_descriptor.annotation.__name__, "TEXT")


def _default(parameter: Any) -> str:
    value = parameter.default
    if value is None or value is False or value == () or callable(value):
        return ""
    if value is True:
        return f"`{parameter.opts[0]}`"
    return f"`{value}`"


def exit_codes() -> list[str]:
    """The numbers that commands end with, from the names that they have in the code."""
    meanings = {
        "DIVERGED": "every motion was lost (`run` and `rerun`: the one motion), or a check failed (`check`, `check-part`)",
        "USER_ERROR": "what was asked for is wrong: one line says where, what was found and what is allowed",
        "REFUTED": "a claim is refuted by a state; of `verify`, a campaign or a budget, a requirement is missed; "
        "of `phasing`, a sign is wrong",
        "UNDECIDED": "nothing is refuted or missed, but a claim or a requirement is not decided",
        "INTERNAL_ERROR": "a fault of starhold itself",
    }
    codes = {name: getattr(arguments, name) for name in vars(arguments) if name in meanings}
    rows = [["0", "done, and proved or met where that was asked"]]
    rows += [[str(code), meanings[name]] for name, code in sorted(codes.items(), key=lambda item: item[1])]
    return ["## Exit codes", "", table(["code", "meaning"], rows), ""]
