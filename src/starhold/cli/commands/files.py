"""The commands that list and write scenario files: `scenarios`, `new`, `schema`."""

from pathlib import Path
from typing import Annotated

import typer

from starhold.cli.arguments import Force
from starhold.errors import InputError


def scenarios(name: Annotated[str | None, typer.Argument(help="print this scenario's text")] = None) -> None:
    """List the built-in scenarios, or print one."""
    from starhold.cli.console import console
    from starhold.scenario.reading import builtin_names, builtin_text, load, nearest

    if name is None:
        for known in builtin_names():
            console.print(f"[bold]{known}[/bold]  {load(known).table.description}", soft_wrap=True)
    elif name not in builtin_names():
        raise InputError("scenarios", "", name, nearest(name, builtin_names()))
    else:
        typer.echo(builtin_text(name), nl=False)


def new(
    path: Annotated[Path, typer.Argument(metavar="FILE.toml", help="the file to write")],
    start: Annotated[str | None, typer.Option("--from", help="copy this built-in scenario instead of the template")] = None,
    wheels: Annotated[bool, typer.Option("--wheels", help="a spacecraft with reaction wheels")] = False,
    libration: Annotated[bool, typer.Option("--libration", help="a craft near a libration point")] = False,
    schema: Annotated[bool, typer.Option("--schema", help="also write a JSON Schema, for editors")] = False,
    force: Force = False,
) -> None:
    """Write a commented scenario file that runs as it is."""
    from starhold.cli.console import console
    from starhold.files import write_text
    from starhold.scenario.reading import builtin_names, builtin_text, nearest
    from starhold.scenario.writing import template_text

    given = {"--wheels": wheels, "--libration": libration, "--from": start is not None}
    options = [option for option, there in given.items() if there]
    if len(options) > 1:
        raise InputError("new", options[0], options[1], "one of the two")
    start = "wheels-orbital" if wheels else start
    if start is not None and start not in builtin_names():
        raise InputError("new", "--from", start, nearest(start, builtin_names()))
    text = template_text("libration-point" if libration else "rigid-body") if start is None else builtin_text(start)
    if not path.name or path.is_dir():
        raise InputError(str(path), "", "a folder", "the name of a file to write")
    beside = path.with_name("starhold.schema.json")
    if schema:
        text = f"#:schema ./{beside.name}\n{text}"
    if path.exists() and not force:
        raise InputError(str(path), "", "a file that exists", "another name, or --force")
    write_text(path, text)
    if schema:
        write_text(beside, _schema_text())
    console.print(f"Wrote {path}. Try: starhold compare {path}", soft_wrap=True)


def schema() -> None:
    """Print the JSON Schema of scenario files."""
    typer.echo(_schema_text(), nl=False)


def _schema_text() -> str:
    import json

    from starhold.scenario.json_schema import json_schema

    return json.dumps(json_schema(), indent=1) + "\n"


COMMANDS = {"scenarios": scenarios, "new": new, "schema": schema}
