"""The command `export`: laws as flight code, runs and requirements for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from starhold.cli.arguments import Certified, ExportOutput, Force, ScenarioFile, Unstable

if TYPE_CHECKING:
    from starhold.export.folder import Exported

RunFile = Annotated[Path, typer.Argument(metavar="RUN", help="a run.nc, or the folder of one")]
Epoch = Annotated[
    str | None, typer.Option(help="UTC at the start of the run; by default the scenario's, else 2000-01-01T12:00:00")
]
ObjectName = Annotated[str, typer.Option("--object", help="name of the spacecraft")]
ObjectId = Annotated[str, typer.Option("--id", help="its international designator")]
Frame = Annotated[str, typer.Option(help="EME2000 (axes of date are rotated to it), or the name of the inertial axes")]
app = typer.Typer(help="Write a law as flight code, a run, or requirements.", no_args_is_help=True, rich_markup_mode=None)


@app.command()
def c(
    file: ScenarioFile,
    law: Annotated[str | None, typer.Option(help="which law of the file; the first if not given")] = None,
    output: ExportOutput = None,
    name: Annotated[
        str | None, typer.Option(metavar="NAME", help="prefix of functions and files; by default the law's name")
    ] = None,
    shell: Annotated[
        list[str] | None, typer.Option(metavar="SHELL", help="wrap it for basilisk, fmu, cfs, fprime or process; repeatable")
    ] = None,
    force: Force = False,
    certify: Certified = True,
    allow_unstable: Unstable = False,
) -> None:
    """Write a law as C99 with a self-test: header, source, CMakeLists.txt and the certificate."""
    from starhold.api import export_c
    from starhold.scenario.reading import load

    scenario = load(file, allow_unstable)
    entry = scenario.pick(law)
    folder = output or Path("results") / f"{scenario.name}-{entry.name}-c"
    print_exported(
        export_c(scenario, folder, entry.name, name=name, shells=shell or (), certify=certify, force=force), folder
    )


@app.command()
def aem(
    run: RunFile,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="the message, such as run.aem")],
    epoch: Epoch = None,
    object_name: ObjectName = "SPACECRAFT",
    object_id: ObjectId = "0000-000A",
    frame: Frame = "EME2000",
    version: Annotated[str, typer.Option(help="version of the message, 1.0 or 2.0")] = "2.0",
    force: Force = False,
) -> None:
    """Write the attitudes of a run as a CCSDS attitude ephemeris message."""
    words = {"epoch": epoch, "object_name": object_name, "object_id": object_id, "frame": frame}
    _write("export_aem", run, output, force, version=version, **words)


@app.command()
def oem(
    run: RunFile,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="the message, such as run.oem")],
    epoch: Epoch = None,
    object_name: ObjectName = "SPACECRAFT",
    object_id: ObjectId = "0000-000A",
    frame: Frame = "EME2000",
    center: Annotated[str, typer.Option(help="the central body")] = "EARTH",
    force: Force = False,
) -> None:
    """Write the orbit of a run as a CCSDS orbit ephemeris message."""
    words = {"epoch": epoch, "object_name": object_name, "object_id": object_id, "frame": frame}
    _write("export_oem", run, output, force, center=center, **words)


@app.command()
def link(
    file: ScenarioFile,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="the header, such as starhold_link.h")],
    law: Annotated[str | None, typer.Option(help="the law whose measurements are sent; by default the first")] = None,
    force: Force = False,
) -> None:
    """Write a C header with the messages of `starhold serve` and the layout of a scenario's measurements."""
    from starhold.cli.console import console
    from starhold.files import write_text
    from starhold.link.header import header
    from starhold.scenario.building import build
    from starhold.scenario.reading import load

    _refuse_present(output, force)
    scenario = load(file)
    write_text(output, header(build(scenario, scenario.pick(law)), scenario.name))
    console.print(f"{output}", soft_wrap=True)


def _write(function: str, given: Path | str, output: Path, force: bool, **words: Any) -> None:
    """Write a file by a function of the Python interface and print its result."""
    from starhold import api
    from starhold.cli.console import console

    _refuse_present(output, force)
    console.print(f"{getattr(api, function)(given, output, **words)}", soft_wrap=True)


def _refuse_present(output: Path, force: bool) -> None:
    from starhold.errors import InputError

    if output.exists() and not force:
        raise InputError(str(output), "", "a file already there", "another one with -o, or --force")


@app.command()
def requirements(
    file: ScenarioFile,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="a .csv or .reqif file to write")],
    original: Annotated[
        Path | None, typer.Option(metavar="FILE", help="a .reqif file to update; unchanged content is kept")
    ] = None,
    force: Force = False,
) -> None:
    """Write the requirements of a scenario for other tools: CSV or ReqIF."""
    _write("export_requirements", file, output, force, original=original)


def print_exported(exported: Exported, folder: Path) -> None:
    """Print the files, the cost of a step, the proved claims, and how to test the code."""
    from rich.markup import escape

    from starhold.cli.console import console

    code, work = exported.code, exported.code.work
    console.print(f"[bold]{code.name}[/bold]: {', '.join(exported.files)} in {folder}", soft_wrap=True)
    shown = f"{work.arithmetic} + - * / and roots, {work.comparisons} comparisons"
    console.print(f"  a step at most: {shown}, every {code.flight.loop.period:g} {code.time_unit}")
    for cost in exported.costs:
        console.print(f"  {cost.target}: {cost.flash} bytes of flash, {cost.stack} of stack ({cost.compiler} -O2)")
    if exported.proof.warning:
        for line in exported.proof.warning.splitlines():
            console.print(f"  [red]warning[/red] {escape(line)}")
    else:
        console.print(f"  [green]proved[/green], {exported.proof.file}, sha256 {exported.proof.digest}", soft_wrap=True)
    console.print(
        f"Test it: cmake -S {folder} -B {folder}/build && cmake --build {folder}/build && ctest --test-dir {folder}/build",
        soft_wrap=True,
    )


COMMANDS = {"export": app}
