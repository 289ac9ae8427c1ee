"""The command line. Commands read, call and print; they import the modules they need when they run, to start fast."""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Mapping
from threading import active_count
from types import ModuleType
from typing import Annotated, Any, cast

import typer

from starhold.cli import commands
from starhold.cli.arguments import INTERNAL_ERROR, USER_ERROR, clause
from starhold.cli.process import Outlet, on_signal, open_outlets
from starhold.errors import InputError, InterruptedByUserError


def make_app(every: Mapping[str, Any]) -> typer.Typer:
    """Return the application with these commands."""
    made = typer.Typer(
        help="Design, certify, fly and compare control laws for spacecraft.",
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )
    for name, command in every.items():
        if isinstance(command, typer.Typer):
            for one in command.registered_commands:
                one.short_help = clause(one.callback.__doc__ or "")
            made.add_typer(command, name=name, short_help=clause(str(command.info.help)))
        else:
            made.command(name, short_help=clause(command.__doc__ or ""))(command)
    made.callback(invoke_without_command=True)(_root)
    return made


def _root(version: Annotated[bool, typer.Option("--version", help="print the version and exit")] = False) -> None:
    if version:
        typer.echo(_version())
        raise typer.Exit


def _version() -> str:
    from starhold.version import __version__

    return f"starhold {__version__}"


COMMANDS = commands.every()
app = make_app(COMMANDS)


def main() -> None:
    """Entry point: user errors become one line and exit code 2, an interrupt 130."""
    open_outlets()
    code = run_command()
    sys.stdout.flush()
    unsaid = cast(Outlet, sys.stdout).failure
    if unsaid is not None and not isinstance(unsaid, BrokenPipeError):
        print(f"starhold: standard output cannot be written: {unsaid.strerror}", file=sys.stderr)
        code = code or USER_ERROR
    if active_count() > 1:
        sys.exit(code)
    # The interpreter would take all loaded modules apart before it ends, which takes longer than `--help`.
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def run_command() -> int:
    """Run the command in `sys.argv`, and return its exit code."""
    # Set before NumPy loads: on matrices as small as a law's, the threads of its library only wait for one another.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Pydantic need not search all installed packages for its plugins either.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    warnings.formatwarning = _as_line
    # A command loads much and ends soon, so frequent garbage collection only costs time.
    gc.set_threshold(200_000)
    if sys.argv[1:] == ["--version"]:
        # This branch avoids loading the modules that parse options.
        print(_version())
        return 0
    if os.environ.get("_STARHOLD_COMPLETE", "").startswith("complete_"):
        # A shell waits for names and needs no values, so the library that converts them is not loaded: completion treats a
        # value that cannot be converted as absent.
        sys.modules["pydantic"] = cast(ModuleType, None)
    chosen = {name: command for name, command in COMMANDS.items() if name in sys.argv[1:2]}
    try:
        # Options of other commands than the requested one take long to make.
        (make_app(chosen) if chosen else app)(standalone_mode=True)
    except SystemExit as ending:
        return ending.code if isinstance(ending.code, int) else int(ending.code is not None)
    except InputError as error:
        print(f"starhold: {error}", file=sys.stderr)
        return USER_ERROR
    except InterruptedByUserError as interrupt:
        print("starhold: interrupted; files already written are complete", file=sys.stderr)
        return 128 + interrupt.args[0]
    except OSError as error:
        # For example a name that is too long or a full disk: an error of the system, not of the program.
        print(f"starhold: {str(error.filename or '')[-100:]}: {error.strerror or error}", file=sys.stderr)
        return USER_ERROR
    except MemoryError:
        print("starhold: not enough memory; a larger simulation.record_every makes recordings smaller", file=sys.stderr)
        return USER_ERROR
    except Exception:
        traceback.print_exc()
        return INTERNAL_ERROR
    return 0


def _as_line(message: Warning | str, category: type[Warning], filename: str, number: int, line: str | None = None) -> str:
    """Return a warning as one line, with its place in the source unless it is meant for users."""
    place = "" if category is UserWarning else f"{category.__name__} at {filename}:{number}: "
    return f"starhold: warning: {place}{message}\n"
