"""The commands `run` and `compare`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from starhold.cli.arguments import (
    DIVERGED,
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
from starhold.cli.process import heed_interrupt
from starhold.errors import CutShortError, InputError

if TYPE_CHECKING:
    from starhold.studies.flight import Flight

DEFAULT = "three-laws"


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
    """Fly one law of a file (by default the first) or, if nested, all laws, each into its own folder. Nothing is proved or
    timed where a process gives the commands."""
    if proof and not certify:
        raise InputError("compare" if nested else "run", "--proof", "--no-certify too", "one of the two")
    from starhold.report.painter import Painter

    # The plotting library loads while the scenario is read and laws fly.
    with Painter(pictures is Drawn.ALL) as painter:
        from starhold.scenario.reading import load

        # Read before the modules that fly and print are loaded, so that errors in it are reported at once.
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
                    heed_interrupt()
                    show(name, done, total)

                for entry, loop in zip(entries, loops, strict=True):
                    for flight in flights[-1:]:
                        keep(flight)
                    try:
                        flights.append(studies.fly_law(scenario, entry, loop, notice, process))
                    except CutShortError as error:
                        # The recording so far is kept.
                        if error.recording is not None:
                            write_run(error.recording, folder / "run.nc")
                            console.print(f"Recording so far: {folder / 'run.nc'}", soft_wrap=True, markup=False)
                        raise
            try:
                if check_step:
                    flights = [
                        studies.check_step(scenario, loop, flight, lambda done, total: heed_interrupt())
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
                # The table does not wait for the figures, and no flight is lost if drawing fails.
                keep(flights[-1])

        if certify and process is None:
            flights = [studies.prove(scenario, *trio, pointing=proof) for trio in zip(entries, loops, flights, strict=True)]
        if any(flight.certificates for flight in flights):
            from starhold.cli.show_certificates import print_proved

            print_proved(flights)
        print_results(write_results(scenario, flights, folder, pictures is not Drawn.NONE))
        painter.finish()
    return flights


COMMANDS = {"run": run, "compare": compare}
