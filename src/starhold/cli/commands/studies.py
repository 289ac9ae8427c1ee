"""Makes a command of each file in `starhold.report.commands`."""

import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from starhold.cli.arguments import REFUTED, UNDECIDED, Drawn, Force, Pictures, Proof, Rocq, Unstable, results_in
from starhold.errors import InputError
from starhold.report.commands import Command, command, names

CODES = {"missed": REFUTED, "undecided": UNDECIDED}


def command_of(name: str) -> Any:
    """Return the function of the command of this name, with its options as parameters."""
    declared = command(name)

    def run(
        output: Path | None = None,
        force: bool = False,
        allow_unstable: bool = False,
        rocq: bool = False,
        pictures: Drawn = Drawn.ALL,
        **given: Any,
    ) -> None:
        from starhold.cli.console import console
        from starhold.cli.show import print_blocks
        from starhold.report.results import open_folder, write_lemmas, write_part, write_result
        from starhold.scenario.reading import load

        file_options = {
            key: output if key == "output" else given.pop(key) for key, option in declared.options.items() if option.file
        }
        paths = {key: path for key, path in file_options.items() if path is not None}
        for key, path in paths.items():
            if declared.options[key].file == "png" and path.suffix.lower() != ".png":
                raise InputError(name, f"--{key}", str(path), f"the name of a PNG file, such as {key}.png")
            if key == "output" and path.exists() and not force:
                raise InputError(str(path), "", "a file that exists", "another name, or --force")
        proof = given.pop("proof", False)
        about = [given.pop(key) for key in ("file", "law") if key in given]
        if about == [None] and declared.listed is not None:
            print_blocks(declared.listed())
            return
        if declared.read is None:
            about[0] = load(about[0], allow_unstable)
        subject = declared.prepare(*about, **{key: value for key, value in given.items() if value is not None})
        folder, title = Path(), getattr(subject[0], "name", "")
        if declared.check is not None:
            declared.check(*subject)
        if declared.suffix:
            folder = open_folder(output or Path("results") / f"{title}-{declared.suffix}", force)
        with _progress(declared) as notice:
            result = declared.result(subject, notice, proof)
        print_blocks(result.blocks)
        shown = result if pictures is Drawn.ALL else result._replace(figure=None)
        written = write_result(shown, name, title, folder) if declared.suffix else dict[str, Path]()
        for key, path in paths.items():
            kind = declared.options[key].file
            written["Table" if kind == "csv" else key.capitalize()] = write_part(result, kind, path)
        written |= {f"For Rocq, coqc {path.name}": path for path in (write_lemmas(folder) if rocq else ())}
        if written:
            console.print(". ".join(f"{what}: {path}" for what, path in written.items()), soft_wrap=True)
        if result.outcome in CODES:
            raise typer.Exit(CODES[result.outcome])

    kinds = _parameters(declared)
    defaults: dict[str, Any] = {key: option.default for key, option in declared.options.items()}
    defaults |= dict.fromkeys(declared.arguments, inspect.Parameter.empty)
    defaults |= {"file": inspect.Parameter.empty} if declared.listed is None else {}
    defaults |= {"proof": False, "force": False, "allow_unstable": False, "rocq": False, "pictures": Drawn.ALL}
    parameters = [
        inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, annotation=kind, default=defaults.get(key))
        for key, kind in kinds.items()
    ]
    run.__doc__, run.__annotations__ = inspect.cleandoc(declared.summary), kinds
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return run


def _parameters(declared: Command) -> dict[str, Any]:
    """Return the types of a command's arguments and options, in order."""
    kinds: dict[str, Any] = {}
    if declared.file is not None:
        kind = str if declared.listed is None else str | None
        kinds["file"] = Annotated[kind, typer.Argument(metavar="FILE", help=declared.file)]
    for key in declared.arguments:
        argument = declared.options[key]
        kinds[key] = Annotated[str, typer.Argument(metavar=argument.argument, help=argument.help)]
    if declared.read is None:
        kinds["law"] = Annotated[str | None, typer.Option(help=declared.law)]
    for key, option in declared.options.items():
        if option.argument:
            continue
        flags = ("-o", "--output") if key == "output" else (f"--{key.replace('_', '-')}",)
        metavar = f"FILE.{option.file}" if option.file else "TIME" if option.key and not option.whole else None
        kind = Path if option.file else int if option.whole else str
        shown = typer.Option(*flags, metavar=metavar, help=option.help)
        kinds[key] = Annotated[kind if option.default else kind | None, shown]
    if declared.prove is not None:
        kinds["proof"] = Proof
    if declared.suffix:
        subject = "SCENARIO" if declared.read is None else "SYSTEM"
        kinds["output"] = Annotated[Path | None, results_in(f"{subject}-{declared.suffix}")]
        kinds |= {"pictures": Pictures} if "png" in declared.kinds else {}
    if declared.proofs:
        kinds["rocq"] = Rocq
    if "output" in kinds:
        kinds["force"] = Force
    return kinds | ({"allow_unstable": Unstable} if declared.unstable else {})


@contextmanager
def _progress(declared: Command) -> Iterator[Callable[[int, int, str], None]]:
    """Show a progress bar; yield the function by which a command reports its progress."""
    if declared.doing is None:
        yield lambda done, total, what: None
        return
    from starhold.cli.console import bars_with

    with bars_with() as bars:
        task = bars.add_task("compiling", total=None)
        yield lambda done, total, what: bars.update(task, completed=done, total=total, description=what)


COMMANDS = {name: command_of(name) for name in names()}
