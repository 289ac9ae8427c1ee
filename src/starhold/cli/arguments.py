"""Arguments and exit codes that several commands share."""

import re
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

USER_ERROR, DIVERGED, FAILED_CHECK, REFUTED, UNDECIDED, INTERNAL_ERROR = 2, 1, 1, 3, 4, 70

ScenarioFile = Annotated[str, typer.Argument(metavar="FILE", help="a scenario file or the name of a built-in scenario")]


def clause(text: str) -> str:
    """Return the first clause of a command's help, for lists of commands, which would break off in the middle of a word."""
    return " ".join(re.split(r"(?<=[.:;])\s", text.strip(), maxsplit=1)[0].split()).rstrip(".:;")


def results_in(where: str) -> Any:
    """Return the option that names the folder for results."""
    return typer.Option("-o", "--output", metavar="DIR", help=f"folder for results, created; else results/{where}")


RunOutput = Annotated[Path | None, results_in("SCENARIO-LAW")]
Output = Annotated[Path | None, results_in("SCENARIO")]
CertifyOutput = Annotated[Path | None, results_in("SCENARIO-certificate")]
CampaignOutput = Annotated[Path | None, results_in("SCENARIO-campaign")]
ReproductionOutput = Annotated[Path | None, results_in("reproduce-PAPER")]
ExportOutput = Annotated[Path | None, results_in("SCENARIO-LAW-c")]
Force = Annotated[bool, typer.Option("--force", help="replace results that are already there")]
Rocq = Annotated[bool, typer.Option("--rocq", help="also write the proofs as lemmas for Rocq: coqc NAME.v")]
Why = Annotated[bool, typer.Option("--why", help="state how each claim was shown and what it assumes")]
Unstable = Annotated[bool, typer.Option("--allow-unstable", help="accept gains that are known to be unstable")]
Certified = Annotated[bool, typer.Option("--certify/--no-certify", help="prove what the laws guarantee, or only fly")]
Proof = Annotated[
    bool, typer.Option("--proof", help="also prove a pointing bound of the loop as it flies; this takes seconds")
]
CheckStep = Annotated[
    bool, typer.Option("--check-step", help="fly again with half the integration step and show the changes")
]


class Drawn(StrEnum):
    """The pictures to draw after the table is printed."""

    NONE = "none"
    PAGE = "page"
    ALL = "all"


Pictures = Annotated[Drawn, typer.Option("--pictures", help="no pictures, report.html only, or PNG files too")]
OneLaw = Annotated[str | None, typer.Option(help="which law of the file; all if not given")]
