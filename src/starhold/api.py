"""The Python interface; each function mirrors a command."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from starhold.analysis.ranking import MetricSet
from starhold.errors import InputError, expect, optional, shortly
from starhold.export.aem import export_aem as export_aem
from starhold.export.aem import read_aem as read_aem
from starhold.export.oem import export_oem as export_oem
from starhold.export.oem import read_oem as read_oem
from starhold.files import passing_folder
from starhold.scenario import reading
from starhold.scenario.reading import make_scenario as make_scenario
from starhold.simulation.lane import Recording
from starhold.studies import compare as studies
from starhold.studies.serving import serve as serve
from starhold.studies.sweep import sweep as sweep
from starhold.synthesis.pole_placement import place as place

if TYPE_CHECKING:
    import xarray as xr
    from pandas import DataFrame

    from starhold.analysis.margins import Margins
    from starhold.analysis.ranking import Metrics
    from starhold.campaign.results import CampaignResult
    from starhold.campaign.verify import Review
    from starhold.certification.certificate import Certificate
    from starhold.certification.invariant import InvariantProblem
    from starhold.export.folder import Exported
    from starhold.publications.reproduction import Reproduction
    from starhold.scenario.designing import Design
    from starhold.simulation.stepper import Stepper
    from starhold.studies.budget import Budget
    from starhold.studies.environment import Environment, Environments, Reward
    from starhold.studies.failures import Failure
    from starhold.studies.flight import Flight
    from starhold.studies.linear import LinearLoop
    from starhold.studies.modal_roots import Study
    from starhold.studies.verification import RequirementVerdict


@shortly
def load(source: str | Path, allow_unstable: bool = False) -> reading.Scenario:
    """Return the scenario in a TOML file, or the built-in one of that name. InputError states the first error in it."""
    return reading.load(source, allow_unstable)


@shortly
def simulate(
    scenario: reading.Scenario | str | Path,
    law: str | None = None,
    progress: Callable[[int, int], None] | None = None,
    process: str | None = None,
) -> xr.Dataset:
    """Fly one law of a scenario, by default the first; process: a program that commands in its place. Returns the Dataset
    that `starhold run` writes to run.nc, with the same attributes; `attrs["diverged_at"]` (s) exists only if the motion
    diverged."""
    opened = reading.open_scenario(scenario)
    entry = opened.pick(law)
    return studies.record(opened, studies.build(opened, entry), progress, process).dataset()


@shortly
def stepper(scenario: reading.Scenario | str | Path, law: str | None = None, *, record: bool = True) -> Stepper:
    """Return a flight that advances by one control period at each call of `step(command)`. Without a command the law, by
    default the first, commands, and the bits are those of `simulate`. record: whether samples are kept for `dataset()`."""
    return steppers(scenario, None, law, record=record)


@shortly
def steppers(
    scenario: reading.Scenario | str | Path, lanes: int | None, law: str | None = None, *, record: bool = False
) -> Stepper:
    """Return `lanes` flights side by side, each with its own random numbers; numbers are arrays (lanes,), commands
    (lanes, 3)."""
    from starhold.simulation.stepper import Stepper

    opened = reading.open_scenario(scenario)
    return Stepper(studies.build(opened, opened.pick(law)), lanes, record)


@shortly
def environment(
    scenario: reading.Scenario | str | Path,
    law: str | None = None,
    *,
    lanes: int | None = None,
    reward: Reward | None = None,
) -> Environment | Environments:
    """Return a scenario as a Gymnasium environment (extra `gym`), or as a vector environment of `lanes` flights. The
    observations are the readings of flight software, the actions its commands. reward: a function of the readings after a
    period and the command; by default minus the angle to the target."""
    optional("gymnasium", "environments", "gym")
    from starhold.studies.environment import Environment, Environments

    opened = reading.open_scenario(scenario)
    return Environment(opened, law, reward) if lanes is None else Environments(opened, lanes, law, reward)


@shortly
def metrics(run: xr.Dataset | Flight) -> Metrics:
    """Return the metrics of a run: a dictionary with numbers, or None where there is no value, whose `units` has the unit
    (SI) of each. run: a Dataset of `simulate` or `run.nc`, measured by the tolerances of its scenario, or a Flight, whose
    metrics are returned. Nothing is flown or timed again, so only a Flight has the cost of the law's calls. ValueError for a
    Dataset that is not a run."""
    if not hasattr(run, "data_vars"):
        expect(getattr(run, "metric_set", run), MetricSet, "metrics", "a run of sh.simulate, or a flight of sh.compare")
        flight = cast("Flight", run)
        return flight.metric_set.measured(flight.metrics)
    recording = Recording.of(cast("xr.Dataset", run))
    return studies.metric_set_of(recording).measured(studies.metrics_of(recording))


@shortly
def campaign(
    scenario: reading.Scenario | str | Path,
    folder: str | Path | None = None,
    *,
    runs: int | None = None,
    over: Mapping[str, Any] | None = None,
    requirement: Iterable[Mapping[str, Any]] | None = None,
    metrics: Iterable[str] | None = None,
    sampling: str | None = None,
    seed: int | None = None,
    law: str | None = None,
    threads: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    gpu: bool = False,
    resume: bool = False,
    force: bool = False,
    until_decided: bool = False,
    search: bool = True,
    proof: bool = False,
    progress: Callable[[str, int], None] | None = None,
) -> CampaignResult:
    """Fly many runs of a scenario with numbers drawn from distributions, judge its requirements, and return the results.

    over: a distribution for each drawn key, {"initial.rate": {"distribution": "shell", "high": "4 deg/s"}}; requirement:
    bounds on metrics, [{"metric": "settling_time", "at_most": 120, "share": 0.99, "confidence": 0.9}]; metrics: additional
    costly metrics, "overshoot" or "iterations". These, with `runs`, `sampling` and `seed`, replace the entries of the
    scenario's [campaign] table. law: one law, by default all. Results are kept in `folder`, by default in one that is
    removed at the end of this process; `resume` flies the runs missing there. threads, workers (processes), scheduler (the
    address of a Dask cluster), gpu: the engine, which does not change a bit of the results. until_decided: stop as soon as
    every requirement is met or missed, after at most `runs`. search: whether to search for worst cases too. proof: whether
    to compare flights with the claim proved about the loop as it flies, which takes seconds per law: `claim` of each law.
    progress: called with a law and the number of further runs flown.

    InputError for any mistake or failure; the runs flown until then are kept."""
    from starhold.campaign.campaign import Options, fly_campaign, with_campaign
    from starhold.campaign.engines import engine_of

    changes: dict[str, Any] = {"runs": runs, "over": over, "metrics": metrics, "sampling": sampling}
    changes |= {"seed": seed, "requirement": requirement}
    # Any iterable is accepted here; a string or a table is refused where it is read.
    plain = {
        key: list(value) if key in ("metrics", "requirement") and not isinstance(value, str | Mapping | None) else value
        for key, value in changes.items()
    }
    options = Options(engine_of(threads, workers, scheduler, gpu), resume, force, until_decided, search, proof)
    place = Path(passing_folder() if folder is None else folder)
    return fly_campaign(with_campaign(reading.open_scenario(scenario), plain), place, law, options, progress)


@shortly
def to_pandas(results: Any) -> DataFrame:
    """Return results as a tidy table: a run with a row per sample and a column per component (`rate_x`), flights and designs
    with a row per law, certificates with a row per claim, margins with a row per axis. TypeError for anything else."""
    from starhold.studies.frames import to_pandas as table_of

    return table_of(results)


@shortly
def design(scenario: reading.Scenario | str | Path, law: str | None = None) -> list[Design]:
    """Return the designed gains with figures of merit, for every law of a scenario that has a `form`, or for the one of this
    name. InputError where there is none."""
    return studied("design", scenario, law)


@shortly
def certify(scenario: reading.Scenario | str | Path, law: str | None = None) -> list[Certificate]:
    """Return certificates with the claims that can be proved about every law of a scenario, or the one of this name, on its
    spacecraft. Each has an `outcome` and `claims` (numbers in SI, scaled for station keeping), and has been tested by ten
    thousand flights."""
    from starhold.studies.certificates import certify_scenario

    return [tried.certificate for tried in certify_scenario(reading.open_scenario(scenario), law)]


@shortly
def compare(scenario: reading.Scenario | str | Path, proof: bool = False) -> list[Flight]:
    """Fly every law of a scenario and return the flights; each has the run (`run`, a Dataset), its `metrics` (SI) and its
    `certificates`. proof: whether to prove a pointing bound for each loop as it flies too, which takes seconds per law."""
    return studies.compare(reading.open_scenario(scenario), pointing=proof)


@shortly
def export_c(
    scenario: reading.Scenario | str | Path,
    folder: str | Path,
    law: str | None = None,
    *,
    name: str | None = None,
    shells: Iterable[str] = (),
    certify: bool = True,
    force: bool = False,
) -> Exported:
    """Write a law of a scenario, by default the first, as C99 into a folder: header, source, a self-test that requires the
    simulation's bits, CMakeLists.txt, and the certificate whose digest is in the header.

    name: the prefix of functions and files, by default the law's name; shells: further wrappers, of "basilisk", "fmu",
    "cfs", "fprime", "process". InputError for a law that cannot be written in C, a name that is not an identifier, and a
    folder that holds results (unless `force`) or cannot be written."""
    import hashlib
    import re

    from starhold.export.code import check_name, make_code
    from starhold.export.folder import make_files, write
    from starhold.export.shells import shell_files
    from starhold.export.source import UNPROVED, proof_of
    from starhold.report.results import open_folder, write_proofs
    from starhold.studies.certificates import certify_scenario

    opened = reading.open_scenario(scenario)
    entry = opened.pick(law)
    code = make_code(studies.build(opened, entry), check_name(re.sub(r"\W", "_", entry.name) if name is None else name))
    more = shell_files(code, shells)
    into, proof = open_folder(Path(folder), force), UNPROVED
    if certify:
        certificates = [tried.certificate for tried in certify_scenario(opened, entry.name)]
        path = write_proofs(certificates, opened.name, into)
        proof = proof_of(certificates, hashlib.sha256(path.read_bytes()).hexdigest())
    exported = make_files(code, opened.name, entry.name, proof, more)
    write(exported, into, opened.name, entry.name)
    return exported


@shortly
def export_requirements(
    scenario: reading.Scenario | str | Path, file: str | Path, original: str | Path | None = None
) -> Path:
    """Write the requirements of a scenario, with their attributes, to a CSV or ReqIF file, depending on its suffix, and
    return the path. original: a ReqIF file whose content is kept except where it differs. A scenario reads such a file where
    a [[requirement]] names it as `file`. InputError for another suffix and where the file cannot be written."""
    from starhold.scenario.requirement_files import write_requirement_file

    into = Path(file)
    try:
        tables = reading.open_scenario(scenario).table.requirement
        write_requirement_file(tables, into, None if original is None else Path(original))
    except OSError as error:
        raise InputError(str(error.filename or into), "", f"{error.strerror}", "files that can be used") from None
    return into


@shortly
def failures(scenario: reading.Scenario | str | Path, law: str | None = None, proof: bool = False) -> list[Failure]:
    """Return the control authority after the loss of any one or two wheels, under a law, by default the first; proof:
    whether to prove a pointing bound after each loss too, which takes seconds each."""
    return studied("failures", scenario, law, proof=proof)


@shortly
def budget(scenario: reading.Scenario | str | Path, law: str | None = None, proof: bool = False) -> Budget:
    """Return the pointing error of a law, by default the first, by source, for the times and windows of the [budget] table.
    Each source flies alone, and all fly together, in the table's number of runs; `level(source, index)` is in rad, `table()`
    a DataFrame with every axis. proof: whether to prove a pointing bound and each source's share of it too, which takes
    seconds each: `proof` of the result. InputError where nothing disturbs the loop, windows do not fit, or a motion
    diverges."""
    return studied("budget", scenario, law, proof=proof)


@shortly
def verify(scenario: reading.Scenario | str | Path, law: str | None = None) -> tuple[RequirementVerdict, ...]:
    """Return the verdicts on a law, by default the first: one for each [[requirement]] of the scenario, in order, with
    number, limit and margin (SI), and the evidence. InputError for any mistake, before anything is flown."""
    return studied("verify", scenario, law)


@shortly
def review(scenario: reading.Scenario | str | Path, law: str | None = None, folder: str | Path | None = None) -> Review:
    """Return the contents of a review of a law, by default the first: `verdicts` and the `evidence` for them; also write
    them as review.html and review.md into a folder without results, if one is given. InputError as in `verify`."""
    from starhold.report.results import study_into

    return study_into("review", (reading.open_scenario(scenario), law), None if folder is None else Path(folder))


@shortly
def linearise(scenario: reading.Scenario | str | Path, law: str | None = None, delay: float = 0.0) -> LinearLoop:
    """Return the linear loop of a law, by default the first, near rest on target, as systems of python-control: `plant`,
    `law`, `loop` (opened at the command) and `closed` in continuous time, and the same in `sampled`, exact for a held
    command. delay: time (s) from the control instant until the command acts. InputError for a law that iterates or switches
    there or whose memory never comes to rest, and where python-control is not installed."""
    from starhold.studies.linear import linear_of, systems_of

    opened = reading.open_scenario(scenario).about("rigid-body")
    return systems_of(linear_of(opened, opened.pick(law), delay))


@shortly
def margins(scenario: reading.Scenario | str | Path, law: str | None = None, delay: float = 0.0) -> list[Margins]:
    """Return the gain, phase and delay margins of the linear loop about each body axis, with the loops about the other axes
    closed. They are those of the sampled loop of `linearise`; NaN, with a warning, where that loop is not stable."""
    from starhold.studies.linear import margins_of

    opened = reading.open_scenario(scenario).about("rigid-body")
    return margins_of(opened, opened.pick(law), delay)


@shortly
def modal_roots(scenario: reading.Scenario | str | Path, law: str | None = None) -> Study:
    """Return the roots of the modal law that slew fastest within the limits of a scenario's [transient] table, and the
    fit."""
    return studied("modal-roots", scenario, law)


@shortly
def studied(name: str, *about: Any, proof: bool = False, **options: Any) -> Any:
    """Run the command of this name as a study of a law of a scenario, or of its own subject, and return what it computes."""
    from starhold.report.commands import command

    declared = command(name)
    if declared.read is None:
        about = (reading.open_scenario(about[0]), *about[1:])
    return declared.studying(proof)(*declared.prepare(*about, **options))


@shortly
def reproduce(letter: str) -> Reproduction:
    """Reproduce the figures and numbers of a publication ("A" to "E"). `rows` has, by name, the printed values, ours and the
    verdict; `figures` has the curves, `changed` the rows whose verdict differs from the recorded one. InputError for any
    other letter."""
    from starhold.publications.paper import paper_of
    from starhold.publications.reproduction import reproduce as make

    return make(paper_of(letter))


@shortly
def invariant(problem: InvariantProblem | str | Path) -> Certificate:
    """Return a certificate of the claims about invariant sets in a problem: one made in Python
    (`starhold.certification.invariant`), one in a TOML file, or the built-in one of that name. Each claim has an `outcome`,
    numbers (`level`, the size of the set) and evidence."""
    return studied("invariant", problem)
