"""The commands `certify` and `check`."""

from pathlib import Path
from typing import Annotated

import typer

from starhold.cli.arguments import (
    FAILED_CHECK,
    REFUTED,
    UNDECIDED,
    CertifyOutput,
    Force,
    OneLaw,
    Rocq,
    ScenarioFile,
    Unstable,
    Why,
)


def certify(
    file: ScenarioFile,
    law: OneLaw = None,
    output: CertifyOutput = None,
    force: Force = False,
    rocq: Rocq = False,
    why: Why = False,
    allow_unstable: Unstable = False,
) -> None:
    """Prove what each law guarantees on this spacecraft: a table and certificate.json.

    Exit code 0: every claim is proved; 3: one is refuted, with the state that refutes it; 4: one is undecided."""
    from starhold.certification.wording import recheck
    from starhold.cli.console import console
    from starhold.cli.show_certificates import print_certificate, print_chain
    from starhold.report.results import open_folder, write_lemmas, write_proofs
    from starhold.scenario.reading import load
    from starhold.studies.certificates import certify_scenario
    from starhold.studies.chain import chains

    scenario = load(file, allow_unstable)
    folder = open_folder(output or Path("results") / f"{scenario.name}-certificate", force)
    tried = certify_scenario(scenario, law)
    for one in tried:
        print_certificate(one, why)
    certificates = [one.certificate for one in tried]
    for name, links in chains(scenario, certificates, law).items():
        print_chain(name, links)
    path = write_proofs(certificates, scenario.name, folder)
    console.print(f"Certificate: {path}. Re-check it: {recheck(certificates, path)}", soft_wrap=True)
    for file_of_lemmas in write_lemmas(folder) if rocq else ():
        console.print(f"For Rocq: coqc {file_of_lemmas}", soft_wrap=True)
    outcomes = {certificate.outcome for certificate in certificates}
    if outcomes != {"proved"}:
        raise typer.Exit(REFUTED if "refuted" in outcomes else UNDECIDED)


def check(
    path: Annotated[Path, typer.Argument(metavar="CERT", help="a certificate.json")],
    law_file: Annotated[
        list[Path] | None,
        typer.Option("--law-file", metavar="FILE", help="a file with a law that the certificate names; repeatable"),
    ] = None,
    scenario: Annotated[
        str | None,
        typer.Option(
            "--scenario", metavar="SCENARIO", help="record the scenario's loops again and compare them with the proofs"
        ),
    ] = None,
) -> None:
    """Check a certificate independently of the program that made it; only the claims are taken from the file. The kernel,
    which is also in kernel.pyz beside the file, checks the proofs; other claims are undecided."""
    import hashlib
    from contextlib import ExitStack

    from starhold.certification.certificate import kernel_bundle
    from starhold.checker import check_file, passed
    from starhold.checker.check import BY_THE_KERNEL
    from starhold.cli.console import console
    from starhold.cli.show_certificates import print_compared, print_findings
    from starhold.conformance.suite import find_law
    from starhold.laws.catalogue import adopted
    from starhold.scenario.reading import load
    from starhold.studies.certificates import compare_programs, left_open

    with ExitStack() as laws:
        # A certificate may come from anywhere, so only files that the user names are run.
        for file in law_file or []:
            law = find_law(str(file))
            laws.enter_context(adopted(law))
        findings = check_file(path)
        whole = passed(findings)
        compared = load(scenario) if whole and scenario is not None else None
        others = [] if compared is None else compare_programs(path, compared)
        beside = [] if compared is None or others else left_open(path, compared)
    if scenario is not None or any(finding.reason == BY_THE_KERNEL for finding in findings):
        print_compared(others, beside, scenario if whole else None)
    print_findings(findings)
    console.print(f"kernel.pyz of this version: sha256 {hashlib.sha256(kernel_bundle()).hexdigest()}", soft_wrap=True)
    if others or not whole:
        raise typer.Exit(FAILED_CHECK)


COMMANDS = {"certify": certify, "check": check}
