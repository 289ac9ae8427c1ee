"""The commands `campaign`, `query` and `rerun`."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from starhold.cli.arguments import (
    DIVERGED,
    INTERNAL_ERROR,
    REFUTED,
    UNDECIDED,
    CampaignOutput,
    Drawn,
    Force,
    OneLaw,
    Pictures,
    RunOutput,
    ScenarioFile,
    Unstable,
)

CampaignFolder = Annotated[Path, typer.Argument(metavar="DIR", help="the folder of a campaign")]


def campaign(
    file: ScenarioFile,
    runs: Annotated[int | None, typer.Option(help="runs of each law; by default as in the file")] = None,
    law: OneLaw = None,
    seed: Annotated[int | None, typer.Option(help="seed of the draws; by default as in the file")] = None,
    sampling: Annotated[
        str | None, typer.Option(help="random, sobol, latin-hypercube, morris or saltelli; by default as in the file")
    ] = None,
    until_decided: Annotated[
        bool, typer.Option("--until-decided", help="stop once every requirement is decided, at the latest after all runs")
    ] = False,
    search: Annotated[bool, typer.Option("--search/--no-search", help="search for worst cases of required metrics")] = True,
    proof: Annotated[
        bool, typer.Option("--proof", help="also compare flights with the claim about the loop; this takes seconds")
    ] = False,
    threads: Annotated[int | None, typer.Option(help="threads of this process; all cores by default")] = None,
    workers: Annotated[int | None, typer.Option(help="processes on this machine in place of threads")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="tcp://HOST:PORT", help="an existing Dask cluster in place of threads")
    ] = None,
    gpu: Annotated[bool, typer.Option("--gpu", help="the NVIDIA GPU of this machine in place of threads")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="fly the runs that are missing from a folder")] = False,
    output: CampaignOutput = None,
    force: Force = False,
    allow_unstable: Unstable = False,
) -> None:
    """Fly many runs with numbers drawn from distributions: verdicts, drivers of failures, the worst runs, report.html."""
    from starhold.campaign.campaign import Options, fly_campaign, with_campaign
    from starhold.campaign.engines import engine_of
    from starhold.cli.console import console
    from starhold.cli.show_campaign import flying_campaign, print_campaign
    from starhold.report.campaign_page import write_campaign
    from starhold.scenario.reading import load

    engine = engine_of(threads, workers, scheduler, gpu)
    scenario = with_campaign(load(file, allow_unstable), {"runs": runs, "seed": seed, "sampling": sampling})
    laws = [entry.name for entry in scenario.laws] if law is None else [scenario.pick(law).name]
    folder = output or Path("results") / f"{scenario.name}-campaign"
    table = scenario.table.campaign
    with flying_campaign(laws, table.runs, bool(table.over)) as notice:
        options = Options(engine, resume, force, until_decided, search, proof)
        result = fly_campaign(scenario, folder, law, options, notice)
    print_campaign(result, scenario.body)
    page = write_campaign(scenario, result)
    console.print(f"Report: {page}", soft_wrap=True)
    if result.contradicted:
        raise typer.Exit(INTERNAL_ERROR)
    if result.met is not True:
        raise typer.Exit(UNDECIDED if result.met is None else REFUTED)


def query(
    folder: CampaignFolder,
    sql: Annotated[str, typer.Argument(metavar="SELECT", help='such as "select avg(effort) from runs where failed"')],
    csv: Annotated[bool, typer.Option("--csv", help="comma-separated values in place of a table")] = False,
) -> None:
    """Query the runs of a campaign in SQL; the table is called runs."""
    from rich.table import Table

    from starhold.campaign.query import query as ask
    from starhold.cli.console import console

    frame = ask(folder, sql, lambda line: print(f"starhold: {line}", file=sys.stderr))
    if csv:
        typer.echo(frame.to_csv(index=False), nl=False)
        return
    table = Table(show_edge=False, pad_edge=False)
    for name in frame.columns:
        table.add_column(str(name), justify="right", overflow="fold")
    for row in frame.head(MOST_ROWS).itertuples(index=False):
        table.add_row(*(_shown(value) for value in row))
    console.print(table, markup=False)
    if len(frame) > MOST_ROWS:
        console.print(f"the first {MOST_ROWS} of {len(frame)} rows; --csv gives all")


MOST_ROWS = 60
"""The largest number of rows printed as a table."""


def _shown(value: Any) -> str:
    if value is None or value != value:
        return "—"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def rerun(
    folder: CampaignFolder,
    run: Annotated[int, typer.Argument(metavar="RUN", help="the number of the run")],
    law: Annotated[str | None, typer.Option(help="which law of the campaign; its first if not given")] = None,
    output: RunOutput = None,
    force: Force = False,
    pictures: Pictures = Drawn.ALL,
) -> None:
    """Fly one run of a campaign again, bit for bit: run.nc, its scenario file, figures and report.html."""
    from starhold.campaign.again import fly_again
    from starhold.cli.console import console
    from starhold.cli.show import print_outcome, print_results
    from starhold.files import write_text
    from starhold.report.painter import Painter
    from starhold.report.results import open_folder, write_results, write_run

    again = fly_again(folder, run, law)
    flight, scenario = again.flight, again.scenario
    place = open_folder(output or Path("results") / f"{scenario.name}-{flight.name}-{run}", force)
    write_run(flight.recording, place / "run.nc")
    write_text(place / "scenario.toml", scenario.text)
    print_outcome([flight])
    with Painter(pictures is Drawn.ALL) as painter:
        painter.draw(scenario, [flight], place)
        page = write_results(scenario, [flight], place, pictures is not Drawn.NONE)
        said = "The same bits as in the campaign."
        if again.differs:
            names = ", ".join(again.differs[:4])
            said = f"[red]Bits differ from the campaign, which another machine may have flown: {names}[/red]"
        console.print(said, soft_wrap=True)
        print_results(page)
        painter.finish()
    if flight.lost is not None:
        raise typer.Exit(DIVERGED)


COMMANDS = {"campaign": campaign, "query": query, "rerun": rerun}
