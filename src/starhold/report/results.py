"""Writes files of results; each gets its name only when it is complete."""

from __future__ import annotations

import json
import math
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from starhold.certification.certificate import FILE as CERTIFICATES
from starhold.certification.certificate import KERNEL, kernel_bundle
from starhold.certification.certificate import write as write_certificates
from starhold.errors import InputError
from starhold.files import atomic_write, claim, clear_unfinished, write_text
from starhold.report import commands
from starhold.report.netcdf import write_netcdf
from starhold.scenario.checking import cut
from starhold.scenario.reading import LONGEST_PATH
from starhold.version import __version__

if TYPE_CHECKING:
    from starhold.certification.certificate import Certificate
    from starhold.scenario.reading import Scenario
    from starhold.simulation.lane import Recording
    from starhold.studies.flight import Flight


SUMMARY, PAGE = "summary.json", "report.html"
INDEX = "index.html"
EXPORT = "export.json"
STUDIED = tuple(
    f"{name}.{kind}"
    for name, command in ((name, commands.command(name)) for name in commands.names())
    if command.suffix
    for kind in command.kinds
)
TIMING = ("timing.json", "timing.png")
MARKS = (SUMMARY, EXPORT, "run.nc", PAGE, INDEX, CERTIFICATES, KERNEL, *TIMING, *STUDIED)
"""Files of which each marks a folder of results."""


def open_folder(folder: Path, force: bool) -> Path:
    """Create the folder for results. A folder that holds results is refused unless `force`, which removes only those
    results."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        claim(folder)
        clear_unfinished(folder)
        # Checked after locking, when no other process can write them.
        marks = [mark for mark in MARKS if (folder / mark).exists()]
        if marks and not force:
            raise InputError(str(folder), "", f"results already there ({marks[0]})", "another folder with -o, or --force")
        with tempfile.NamedTemporaryFile(dir=folder):
            pass
    except BlockingIOError:
        raise InputError(str(folder), "", "another starhold is writing there", "another folder with -o") from None
    except OSError as error:
        shown = cut(str(folder), LONGEST_PATH)
        raise InputError(shown, "", "", f"cannot write there: {error.strerror}; name another folder with -o") from None
    if marks:
        _clear(folder)
    return folder


def _clear(folder: Path) -> None:
    """Remove the files that an earlier command wrote, and nothing else."""
    try:
        laws = list(json.loads((folder / SUMMARY).read_text(encoding="utf-8"))["laws"])
    except (OSError, ValueError, KeyError, TypeError):
        laws = []
    for name in laws:
        (folder / Path(name).name / "run.nc").unlink(missing_ok=True)
        if (folder / name).is_dir() and not any((folder / name).iterdir()):
            (folder / name).rmdir()
    for name in _lemma_files(folder):
        (folder / name).unlink(missing_ok=True)
    for name in _exported(folder):
        (folder / name).unlink(missing_ok=True)
        for above in (folder / name).parents:
            if above == folder or not above.is_dir() or any(above.iterdir()):
                break
            above.rmdir()
    for mark in MARKS:
        (folder / mark).unlink(missing_ok=True)


def _exported(folder: Path) -> list[str]:
    """Return the files that an earlier export wrote into this folder."""
    try:
        names = [Path(name) for name in json.loads((folder / EXPORT).read_text(encoding="utf-8"))["files"]]
        # Never a file outside the folder, whatever the list contains.
        return [str(name) for name in names if not name.is_absolute() and ".." not in name.parts]
    except (OSError, ValueError, KeyError, TypeError):
        return []


def _lemma_files(folder: Path) -> dict[str, list[int]]:
    """Return the Rocq files of a folder's certificates, each with the indices of its proofs in certificate.json."""
    files = dict[str, list[int]]()
    try:
        content: Any = json.loads((folder / CERTIFICATES).read_text(encoding="utf-8"))
        alone = [{"name": "lemmas", "claims": [], "proof": [*range(len(content["claims"]))]}]
        for given in content.get("certificates", alone):
            places = [claim["proof"] for claim in given["claims"] if "proof" in claim] + given.get("proof", [])
            name = re.sub(r"\W", "_", given["name"], flags=re.ASCII)
            if places:
                files[f"{name}.v" if name[:1].isalpha() else f"law_{name}.v"] = places
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    return files


def write_lemmas(folder: Path) -> list[Path]:
    """Write the kernel's checks of a folder's certificate.json as lemmas for Rocq, one file per certificate in it; return
    the paths."""
    from starhold.certification.rocq import printed
    from starhold.kernel.check import check

    files = _lemma_files(folder)
    proved = check((folder / CERTIFICATES).read_text(encoding="utf-8")) if files else []
    for name, places in files.items():
        write_text(folder / name, printed([proved[place] for place in places]))
    return [folder / name for name in files]


def write_run(run: Recording, path: Path) -> None:
    """Write a run as netCDF-4."""
    path.parent.mkdir(exist_ok=True)
    with atomic_write(path) as hidden:
        write_netcdf(run, hidden)


def write_summary(scenario: str, results: dict[str, Any], path: Path) -> None:
    """Write the metrics of each law of a scenario of this name in SI units as JSON; a missing value is null."""
    content = {"scenario": scenario, "starhold_version": __version__, "laws": _finite(results)}
    write_text(path, json.dumps(content, indent=2, allow_nan=False) + "\n")


def _finite(value: Any) -> Any:
    """Return a value with None in place of numbers that are not finite."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in cast("dict[Any, Any]", value).items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in cast("list[Any]", value)]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_result(result: commands.Result, name: str, subject: str, folder: Path) -> dict[str, Path]:
    """Write the results of a study of a subject into an existing folder; return the paths of its table, its certificate and
    its picture, where they exist."""
    written = dict[str, Path]()
    if result.numbers is not None:
        written["Table"] = write_part(result, "csv", folder / f"{name}.csv")
    if result.summary is not None:
        write_summary(subject, dict(result.summary), folder / SUMMARY)
    if result.certificate is not None:
        written["Certificate"] = folder / CERTIFICATES
        with atomic_write(written["Certificate"]) as hidden:
            result.certificate(hidden)
        if json.loads(written["Certificate"].read_text(encoding="utf-8"))["claims"]:
            _write_kernel(folder)
    page = markdown = None
    if result.document is not None:
        from starhold.report.document import pages_of
        from starhold.report.page_parts import versions

        page, markdown = pages_of(result.title, result.document, f"{versions()}.")
    texts = {"Page": ("html", page), "Markdown": ("md", markdown)}
    texts |= {"For CI": ("xml", result.xml), "Scenario": ("toml", result.toml)}
    for what, (kind, text) in texts.items():
        if text is not None:
            written[what] = folder / f"{name}.{kind}"
            write_text(written[what], text)
    if result.figure is not None:
        written["Picture"] = write_part(result, "png", folder / f"{name}.png")
    return written


def study_into(name: str, about: tuple[Any, ...], folder: Path | None) -> Any:
    """Run the study of the command of this name and return what it computed; write the result into the folder, if given.
    InputError, before anything is computed, if the folder holds results or cannot be written."""
    declared = commands.command(name)
    subject = declared.prepare(*about)
    into = None if folder is None else open_folder(folder, force=False)
    computed = declared.study(*subject)
    if into is not None:
        write_result(declared.present(*subject, computed), name, subject[0].name, into)
    return computed


def write_part(result: commands.Result, kind: str, path: Path) -> Path:
    """Write the numbers of a result ("csv") or its figure ("png"), and return the path."""
    from starhold.report.figures import save
    from starhold.report.tables import write_table

    if kind == "csv":
        assert result.numbers is not None
        write_table(result.numbers, path)
        return path
    assert result.figure is not None
    return save(result.figure(), path)


def write_proofs(certificates: Sequence[Certificate], name: str, folder: Path) -> Path:
    """Write certificates as one file of a folder, and beside it the kernel that checks their proofs; return its path."""
    path = folder / CERTIFICATES
    with atomic_write(path) as hidden:
        write_certificates(certificates, name, hidden)
    if any(certificate.proofs for certificate in certificates):
        _write_kernel(folder)
    return path


def _write_kernel(folder: Path) -> None:
    with atomic_write(folder / KERNEL) as hidden:
        hidden.write_bytes(kernel_bundle())


def write_results(scenario: Scenario, flights: Sequence[Flight], folder: Path, drawn: bool = True) -> Path:
    """Write summary, certificates and, if requested, the page into an existing folder; return the path of the page, or of
    the folder where there is none. `write_run` writes the runs, and a `Painter` the figures."""
    write_summary(scenario.name, {flight.name: flight.results() for flight in flights}, folder / SUMMARY)
    if certificates := [certificate for flight in flights for certificate in flight.certificates]:
        write_proofs(certificates, scenario.name, folder)
    if not drawn:
        return folder
    from starhold.report.page import render

    write_text(folder / PAGE, render(scenario, flights))
    return folder / PAGE
