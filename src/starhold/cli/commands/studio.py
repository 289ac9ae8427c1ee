"""The command that serves the studio."""

from pathlib import Path
from typing import Annotated

import typer

from starhold.errors import InputError, optional


def studio(
    file: Annotated[
        str | None, typer.Argument(metavar="FILE", help="a scenario file, or the name of a built-in scenario to begin with")
    ] = None,
    port: Annotated[int, typer.Option(help="the port to listen on, on this machine only; 0: any free one")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="open the page in the browser")] = True,
) -> None:
    """Serve a page on this machine: edit a scenario, certify, design, fly and compare, and see results side by side."""
    from starhold.cli.console import console
    from starhold.files import read_text
    from starhold.scenario.reading import builtin_names, builtin_text, nearest
    from starhold.scenario.writing import template_text

    for name in ("starlette", "uvicorn"):
        optional(name, "studio", "studio")
    if not 0 <= port < 65536:
        raise InputError("studio", "--port", str(port), "0 to 65535")
    path, name, text = None, "mine.toml", template_text("rigid-body")
    if file is not None and file in builtin_names() and not Path(file).is_file():
        name, text = f"{file}.toml", builtin_text(file)
    elif file is not None:
        path = Path(file)
        name = path.name
        try:
            text = read_text(path)
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or type(error).__name__
            allowed = f"a scenario file, or a built-in scenario: {nearest(file, builtin_names())}"
            raise InputError(file, "", why, allowed) from None

    from starhold.studio.server import serve

    def announce(address: str) -> None:
        console.print(f"Studio: {address}", soft_wrap=True, markup=False)
        console.print("Nothing leaves this machine. Ctrl-C ends it.")

    serve(path, name, text, port, announce, browser)


COMMANDS = {"studio": studio}
