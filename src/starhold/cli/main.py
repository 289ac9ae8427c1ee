"""The command line. Commands read, call and print; they import what they need when they run, so that each starts fast."""

from __future__ import annotations

import gc
import os
import signal
import sys
import traceback
import warnings
from pathlib import Path
from threading import Event
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, cast

import typer

from starhold.cli import campaign, certifying, export, parts, reproduce, serve, studio, study
from starhold.cli.arguments import (
    DIVERGED,
    INTERNAL_ERROR,
    USER_ERROR,
    Certified,
    CheckStep,
    Drawn,
    Force,
    Output,
    Pictures,
    Proof,
    RunOutput,
    ScenarioFile,
    Unstable,
)
from starhold.cli.study import Outlet, open_outlets
from starhold.errors import CutShortError, InputError, InterruptedByUserError
from starhold.report.commands import names

if TYPE_CHECKING:
    from starhold.studies.flight import Flight

app = typer.Typer(
    help="Design, certify, fly and compare control laws for spacecraft.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

DEFAULT = "three-laws"


@app.command()
def run(
    file: ScenarioFile = DEFAULT,
    law: Annotated[str | None, typer.Option(help="which law of the file; the first if not given")] = None,
    output: RunOutput = None,
    force: Force = False,
    allow_unstable: Unstable = False,
    certify: Certified = True,
    proof: Proof = False,
    check_step: CheckStep = False,
    pictures: Pictures = Drawn.ALL,
    law_process: Annotated[
        str | None,
        typer.Option(metavar="PROGRAM", help="a program that commands in place of the law: see `export c --shell process`"),
    ] = None,
) -> None:
    """Fly one law: run.nc, summary.json, figures and report.html."""
    for option, is_given in (("--check-step", check_step), ("--proof", proof)):
        if law_process is not None and is_given:
            raise InputError("run", option, "--law-process too", "one of the two")
    flights = _fly(
        file, law, output, force, allow_unstable, certify, proof, check_step, pictures, nested=False, process=law_process
    )
    if flights[0].lost is not None:
        raise typer.Exit(DIVERGED)


@app.command()
def compare(
    file: ScenarioFile = DEFAULT,
    output: Output = None,
    force: Force = False,
    allow_unstable: Unstable = False,
    certify: Certified = True,
    proof: Proof = False,
    check_step: CheckStep = False,
    pictures: Pictures = Drawn.ALL,
) -> None:
    """Fly every law of a file on the same problem: ranked table, figures and report.html."""
    flights = _fly(file, None, output, force, allow_unstable, certify, proof, check_step, pictures, nested=True)
    if all(flight.lost is not None for flight in flights):
        raise typer.Exit(DIVERGED)


def _fly(
    file: str,
    law: str | None,
    output: Path | None,
    force: bool,
    allow_unstable: bool,
    certify: bool,
    proof: bool,
    check_step: bool,
    pictures: Drawn,
    nested: bool,
    process: str | None = None,
) -> list[Flight]:
    """Fly one law of a file (the first if `law` is None) or, nested, all of them, each into a folder of its own. Where a
    process gives the commands, nothing is proved or timed."""
    if proof and not certify:
        raise InputError("compare" if nested else "run", "--proof", "--no-certify too", "one of the two")
    from starhold.report.painter import Painter

    # Its library loads while the scenario is read and laws fly.
    with Painter(pictures is Drawn.ALL) as painter:
        from starhold.scenario.reading import load

        # Read before the modules that fly and print are loaded, so that its errors are reported at once.
        scenario = load(file, allow_unstable)
        from starhold.cli.console import console
        from starhold.cli.show import flying, print_outcome, print_results
        from starhold.report.results import open_folder, write_results, write_run
        from starhold.studies import compare as studies
        from starhold.studies.timing import Stopwatch

        entries = list(scenario.laws) if nested else [scenario.pick(law)]
        # All are built before the first flight, so that an error in the last is reported at once.
        loops = [studies.build(scenario, entry) for entry in entries]
        name = scenario.name if nested else f"{scenario.name}-{entries[0].name}"
        folder = open_folder(output or Path("results") / name, force)
        flights: list[Flight] = []

        def keep(flight: Flight) -> None:
            write_run(flight.recording, (folder / flight.name if nested else folder) / "run.nc")

        with Stopwatch(scenario, loops if process is None else []) as stopwatch:
            with flying(entries, scenario.table.simulation.steps) as show:

                def notice(name: str, done: int, total: int) -> None:
                    _heed_interrupt()
                    show(name, done, total)

                for entry, loop in zip(entries, loops, strict=True):
                    for flight in flights[-1:]:
                        keep(flight)
                    try:
                        flights.append(studies.fly_law(scenario, entry, loop, notice, process))
                    except CutShortError as error:
                        # Nothing that was flown is lost.
                        if error.recording is not None:
                            write_run(error.recording, folder / "run.nc")
                            console.print(f"Recording so far: {folder / 'run.nc'}", soft_wrap=True, markup=False)
                        raise
            try:
                if check_step:
                    flights = [
                        studies.check_step(scenario, loop, flight, lambda done, total: _heed_interrupt())
                        for loop, flight in zip(loops, flights, strict=True)
                    ]
                if process is None:
                    flights = [stopwatch.timed(place, flight) for place, flight in enumerate(flights)]
                print_outcome(flights)
                if process is not None:
                    said = f"The commands came from {process}: nothing is proved about it."
                    console.print(said, soft_wrap=True, markup=False)
                painter.draw(scenario, flights, folder)
            finally:
                # The table does not wait for it, and no flight is lost if it fails.
                keep(flights[-1])

        if certify and process is None:
            flights = [studies.prove(scenario, *trio, pointing=proof) for trio in zip(entries, loops, flights, strict=True)]
        if any(flight.certificates for flight in flights):
            from starhold.cli.show_certificates import print_proved

            print_proved(flights)
        print_results(write_results(scenario, flights, folder, pictures is not Drawn.NONE))
        painter.finish()
    return flights


app.command()(campaign.campaign)
app.command()(campaign.query)
app.command()(campaign.rerun)
app.command()(certifying.certify)
app.command()(certifying.check)
for studied in names():
    app.command(studied)(study.command_of(studied))
app.command()(reproduce.reproduce)
app.add_typer(export.app, name="export")
app.command()(serve.serve)
app.command()(studio.studio)
app.command()(parts.parts)
app.command("check-part")(parts.check_part)
app.command("check-law", help="The old name of check-part.")(parts.check_part)
app.command()(parts.laws)
app.command()(parts.wheels)


@app.command()
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


@app.command()
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


@app.command()
def schema() -> None:
    """Print the JSON Schema of scenario files."""
    typer.echo(_schema_text(), nl=False)


def _schema_text() -> str:
    import json

    from starhold.scenario.json_schema import json_schema

    return json.dumps(json_schema(), indent=1) + "\n"


@app.callback(invoke_without_command=True)
def _root(version: Annotated[bool, typer.Option("--version", help="print the version and exit")] = False) -> None:
    if version:
        typer.echo(_version())
        raise typer.Exit


def _version() -> str:
    from starhold.version import __version__

    return f"starhold {__version__}"


_interrupted = Event()


def _interrupt(number: int, frame: object) -> None:
    # Noted as well as raised, because an exception in a callback of the garbage collector is swallowed.
    _interrupted.set()
    raise InterruptedByUserError(number)


def _heed_interrupt() -> None:
    if _interrupted.is_set():
        raise InterruptedByUserError(signal.SIGINT)


def main() -> None:
    """Entry point: user errors become one line and exit code 2, an interrupt 130."""
    open_outlets()
    code = run_command()
    sys.stdout.flush()
    unsaid = cast(Outlet, sys.stdout).failure
    if unsaid is not None and not isinstance(unsaid, BrokenPipeError):
        print(f"starhold: standard output cannot be written: {unsaid.strerror}", file=sys.stderr)
        code = code or USER_ERROR
    # At the end the interpreter would look several times through all that was loaded for what is no longer in use.
    gc.freeze()
    sys.exit(code)


def run_command() -> int:
    """Run the command in `sys.argv`, and return its exit code."""
    # Set before NumPy loads: on matrices as small as a law's, the threads of its library only wait for one another.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Nor are plugins of the library that reads tables sought in all installed packages.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)
    warnings.formatwarning = _as_line
    # A command loads much and ends soon, so frequent garbage collection only costs time.
    gc.set_threshold(200_000)
    if sys.argv[1:] == ["--version"]:
        # This path avoids the modules that parse options.
        print(_version())
        return 0
    if os.environ.get("_STARHOLD_COMPLETE", "").startswith("complete_"):
        # A shell waits for names and needs no values, so the library that converts them is not loaded: completion takes a
        # value that cannot be converted for absent.
        sys.modules["pydantic"] = cast(ModuleType, None)
    try:
        app(standalone_mode=True)
    except SystemExit as ending:
        return ending.code if isinstance(ending.code, int) else int(ending.code is not None)
    except InputError as error:
        print(f"starhold: {error}", file=sys.stderr)
        return USER_ERROR
    except InterruptedByUserError as interrupt:
        print("starhold: interrupted; files already written are whole", file=sys.stderr)
        return 128 + interrupt.args[0]
    except OSError as error:
        # A name that is too long, a full disk: an error of the system, not of the program.
        print(f"starhold: {str(error.filename or '')[-100:]}: {error.strerror or error}", file=sys.stderr)
        return USER_ERROR
    except MemoryError:
        print("starhold: not enough memory; simulation.record_every makes a run's record smaller", file=sys.stderr)
        return USER_ERROR
    except Exception:
        traceback.print_exc()
        return INTERNAL_ERROR
    return 0


def _as_line(message: Warning | str, category: type[Warning], filename: str, number: int, line: str | None = None) -> str:
    """Print a warning as one line, with its place in the source unless it is meant for users."""
    place = "" if category is UserWarning else f"{category.__name__} at {filename}:{number}: "
    return f"starhold: warning: {place}{message}\n"
