"""The command that serves a plant to flight software."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from starhold.cli.arguments import DIVERGED, FAILED_CHECK, Force, ScenarioFile, Unstable


def serve(
    file: ScenarioFile,
    law: Annotated[str | None, typer.Option(help="the law whose measurements are sent; by default the first")] = None,
    host: Annotated[
        str, typer.Option(help="the address to listen on; any other than this machine's is open to the network")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="the port to listen on; 0: any free one")] = 5750,
    udp: Annotated[bool, typer.Option("--udp", help="listen on UDP; TCP if not given")] = False,
    zmq: Annotated[bool, typer.Option("--zmq", help="listen on ZeroMQ, as a ROUTER (extra `zmq`)")] = False,
    serial: Annotated[
        str | None, typer.Option(metavar="DEVICE", help="listen on a serial line, such as /dev/ttyUSB0 (extra `serial`)")
    ] = None,
    baud: Annotated[int, typer.Option(help="baud rate of the serial line, 8N1")] = 115200,
    rate: Annotated[
        float | None, typer.Option(help="fly in real time, at this multiple of the clock's speed; lockstep if not given")
    ] = None,
    missing: Annotated[
        str, typer.Option(metavar="hold|zero|stop", help="the command in a period of real time without one")
    ] = "hold",
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="folder for run.nc and the timing in real time; created"),
    ] = None,
    force: Force = False,
    allow_unstable: Unstable = False,
) -> None:
    """Serve the plant of a scenario: flight software connects, reads and commands, in lockstep or in real time."""
    from rich.live import Live

    from starhold.api import serve as serve_plant
    from starhold.cli.console import console
    from starhold.link.plant import Ending, status
    from starhold.report.results import open_folder, write_run
    from starhold.report.timing import write_timing
    from starhold.scenario.reading import load

    scenario = load(file, allow_unstable)

    def announce(address: str) -> None:
        # All other refusals come before this line, and nothing has been flown yet.
        if output is not None:
            open_folder(output, force)
        console.print(f"Listening on {address}. Ctrl-C ends it.", soft_wrap=True, markup=False)
        # Flushed, because a program that waits for this line reads a pipe.
        console.file.flush()

    with Live(console=console, auto_refresh=False, transient=True, redirect_stdout=False, redirect_stderr=False) as live:
        served = serve_plant(
            scenario,
            law,
            host=host,
            port=port,
            udp=udp,
            zmq=zmq,
            serial=serial,
            baud=baud,
            rate=rate,
            missing=missing,
            announce=announce,
            watch=(lambda plant: live.update(status(plant), refresh=True)) if console.is_terminal else None,
        )
    for line in served.lines:
        console.print(line, soft_wrap=True, markup=False)
    if output is not None:
        write_run(served.recording, output / "run.nc")
        console.print(f"Recording: {output / 'run.nc'}", soft_wrap=True, markup=False)
        if served.timing is not None:
            console.print(f"Latencies: {write_timing(served.timing, output)}", soft_wrap=True, markup=False)
    codes = {Ending.DIVERGED: DIVERGED, Ending.GONE: FAILED_CHECK, Ending.MISSED: FAILED_CHECK}
    codes[Ending.INTERRUPTED] = 128 + served.signal
    if code := codes.get(served.ending, 0):
        raise typer.Exit(code)


COMMANDS = {"serve": serve}
