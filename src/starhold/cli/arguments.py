"""Arguments and exit codes that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

USER_ERROR, DIVERGED, FAILED_CHECK, REFUTED, UNDECIDED, INTERNAL_ERROR = 2, 1, 1, 3, 4, 70

ScenarioFile = Annotated[str, typer.Argument(metavar="FILE", help="a scenario file or the name of a built-in scenario")]


def _results(where: str) -> Any:
    return typer.Option("-o", "--output", metavar="DIR", help=f"folder for results, created; else results/{where}")


RunOutput = Annotated[Path | None, _results("SCENARIO-LAW")]
Output = Annotated[Path | None, _results("SCENARIO")]
CertifyOutput = Annotated[Path | None, _results("SCENARIO-certificate")]
FailuresOutput = Annotated[Path | None, _results("SCENARIO-failures")]
BudgetOutput = Annotated[Path | None, _results("SCENARIO-budget")]
RootsOutput = Annotated[Path | None, _results("SCENARIO-roots")]
CampaignOutput = Annotated[Path | None, _results("SCENARIO-campaign")]
ReproductionOutput = Annotated[Path | None, _results("reproduce-PAPER")]
InvariantOutput = Annotated[Path | None, _results("SYSTEM-invariant")]
ExportOutput = Annotated[Path | None, _results("SCENARIO-LAW-c")]
Force = Annotated[bool, typer.Option("--force", help="replace results that are already there")]
Unstable = Annotated[bool, typer.Option("--allow-unstable", help="take gains that are known to be unstable")]
Certified = Annotated[bool, typer.Option("--certify/--no-certify", help="prove what the laws guarantee, or fly alone")]
CheckStep = Annotated[bool, typer.Option("--check-step", help="fly again with half the integration step: how much changes?")]
OneLaw = Annotated[str | None, typer.Option(help="which law of the file; all if not given")]
