"""Commands that declare their results; each file has the name of its command and defines a `COMMAND`. The command line and
the Python interface offer every command of this folder, the studio those about a scenario."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

from starhold.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

    from starhold.report.document import Section
    from starhold.scenario.reading import Scenario
    from starhold.studies.body import Notice

OUTCOMES = {
    **dict.fromkeys(("met", "proved", "settled", "kept", "agrees", "holds", "passed"), "green"),
    **dict.fromkeys(("missed", "refuted", "diverged", "exceeded", "differs", "fails", "failed"), "red"),
    **dict.fromkeys(("not decided", "undecided", "not settled", "close", "depends"), "yellow"),
    **dict.fromkeys(("not checked", "not proved", "not sought"), "yellow"),
    **dict.fromkeys(("not claimed", "does not apply"), "dim"),
}
"""The colour of each outcome: good, bad, undecided or not applicable."""


def coloured(outcome: str, text: str = "") -> str:
    """Return an outcome, or a text in its place, with the style marks of the outcome's colour, if it has one."""
    colour = OUTCOMES.get(outcome)
    return f"[{colour}]{text or outcome}[/{colour}]" if colour else text


class Column(NamedTuple):
    """A column of a table: its heading, the unit below it, the format of its numbers ("" for words), and its meaning."""

    name: str
    unit: str = ""
    format: str = ""
    meaning: str = ""


class Cell(NamedTuple):
    """Styled text in a table. kind: "law", in the colour of the law of this number; "name", which names its row, with detail
    below it; an outcome, such as "met" or "missed"; "best" of its column; "typed", to be copied; "section", a link to the
    section of a document that detail names; "share", with a bar below it for this share of the column's width; "shade", in
    the colour that detail names, whose strength depends on the number; for any other kind detail explains the text."""

    text: str
    kind: str = ""
    number: float = 0.0
    detail: str = ""

    def __format__(self, form: str) -> str:
        return self.text


class Table(NamedTuple):
    """Columns and rows. A cell is a number, several numbers, text, a `Cell`, or None if empty. bold: indices of highlighted
    rows; ends: indices of rows followed by a line; note: shown below it by the reports of campaigns."""

    columns: Sequence[Column]
    rows: Sequence[Sequence[Any]]
    title: str = ""
    bold: Collection[int] = ()
    ends: Collection[int] = ()
    note: str = ""

    def heads(self) -> list[str]:
        """Return the headings, each with its unit."""
        return [f"{column.name} ({column.unit})" if column.unit else column.name for column in self.columns]

    def texts(self) -> list[list[str]]:
        """Return the cells as text; an empty one is a dash, and text keeps its style marks."""
        return [
            [
                value if isinstance(value, str) else "—" if value is None else format(value, column.format)
                for value, column in zip(row, self.columns, strict=True)
            ]
            for row in self.rows
        ]


class Heading(NamedTuple):
    """A highlighted name, and the text that follows it on the same line."""

    name: str
    rest: str = ""


Block: TypeAlias = Table | Heading | str
"""A block of output; "" is an empty line."""


class Result(NamedTuple):
    """The result of a study. blocks: text and tables to read, in order. The others are contents of files, or None: numbers,
    everything computed in SI and radians, for NAME.csv; figure, a function that draws NAME.png; summary, by law, for
    summary.json; xml and toml, the texts of NAME.xml and NAME.toml; certificate, a function that writes one; document, for
    NAME.html and NAME.md. outcome: whether everything required is met, or proved."""

    title: str
    blocks: Sequence[Block]
    numbers: Table | None = None
    figure: Callable[[], Any] | None = None
    summary: Mapping[str, Any] | None = None
    xml: str | None = None
    certificate: Callable[[Path], None] | None = None
    document: Sequence[Section] | None = None
    outcome: Literal["met", "missed", "undecided"] = "met"
    toml: str | None = None


class Option(NamedTuple):
    """An option of a command. key: the scenario key whose value it replaces, a whole number if `whole`, else a time; "" for
    a text that `read` takes. file: "csv" or "png" for an option that names the file of the numbers or of the figure.
    content: a function that converts the text to an argument of `study` after the law, which is None without the option.
    argument: its name in the help if it is a required argument after FILE instead of an option."""

    key: str
    help: str
    whole: bool = False
    default: str | None = None
    file: Literal["", "csv", "png"] = ""
    content: Callable[[str], Any] | None = None
    argument: str = ""


def number_or_text(value: str | float) -> str | float:
    """Return a value as in a scenario file: a number, in SI, if the text is one."""
    try:
        return float(value) if isinstance(value, str) else value
    except ValueError:
        return value


def as_given(text: str) -> str:
    """Return a text unchanged; the `content` of an option that is neither a key nor the name of a file."""
    return text


def later(path: str, **more: Any) -> Callable[..., Any]:
    """Return the function at a path below starhold, with these arguments; its module is loaded at the first call."""
    module, _, name = path.rpartition(".")
    return lambda *given: getattr(import_module(f"starhold.{module}"), name)(*given, **more)


class Command(NamedTuple):
    """A command about a law of a scenario, or about another subject that `read` returns. summary: its purpose in a sentence.
    suffix: results go to SUBJECT-suffix; "" if none are written by default. study: computes the numbers from a scenario, a
    law and, if `doing` is set, a callback that takes the number done, the total and the next item ("" at the end). present:
    makes the Result from these arguments and the numbers. pick: returns the law for a name or None; InputError if it cannot
    be studied. law: help for --law. doing: label of the progress bar. unstable: whether --allow-unstable exists. body: the
    body that scenarios must have, "" for any. file: help for FILE, None for a command without one; listed: returns the
    blocks shown without FILE, if that is allowed. read: returns the subject in place of a scenario and a law, from FILE and
    options. proofs: whether a certificate is written and --rocq exists. kinds: suffixes of the files NAME.*. prove: the
    study together with a proof of the pointing bound, if --proof exists. check: takes the arguments of study and refuses
    files that they name before a folder for results is opened."""

    summary: str
    suffix: str
    study: Callable[..., Any]
    present: Callable[..., Result]
    pick: Callable[[Scenario, str | None], Any] = lambda scenario, law: scenario.pick(law)
    law: str = "which law of the file; the first if not given"
    doing: str | None = "{}"
    options: Mapping[str, Option] = {}
    unstable: bool = False
    body: str = "rigid-body"
    file: str | None = "a scenario file or the name of a built-in scenario"
    listed: Callable[[], Sequence[Block]] | None = None
    read: Callable[..., tuple[Any, ...]] | None = None
    proofs: bool = False
    kinds: tuple[str, ...] = ("csv", "png", "xml")
    prove: Callable[..., Any] | None = None
    check: Callable[..., Any] | None = None

    def prepare(self, *about: Any, **given: Any) -> tuple[Any, ...]:
        """Return the arguments of `study`: the scenario, changed by options, and the law; or those from `read`."""
        if self.read is not None:
            defaults = {name: option.default for name, option in self.options.items() if not option.file}
            return self.read(*about, **defaults | given)
        scenario: Scenario = about[0].about(self.body) if self.body else about[0]
        readers = {name: option.content for name, option in self.options.items() if option.content is not None}
        for name in self.arguments:
            if given.get(name) is None:
                raise InputError(self.suffix, name, "nothing", self.options[name].help)
        texts = [(read, given.pop(name, None)) for name, read in readers.items()]
        if given:
            scenario = scenario.with_({self.options[name].key: number_or_text(value) for name, value in given.items()})
        files = [None if text is None else read(text) for read, text in texts]
        return scenario, self.pick(scenario, *about[1:] or (None,)), *files

    @property
    def arguments(self) -> list[str]:
        """The names of the required arguments after FILE."""
        return [name for name, option in self.options.items() if option.argument]

    @property
    def offered(self) -> bool:
        """Whether the command needs no argument but a scenario."""
        return self.read is None and not self.arguments

    def studying(self, proof: bool) -> Callable[..., Any]:
        """Return the function that computes the study, with the proof if requested."""
        return self.prove if proof and self.prove is not None else self.study

    def result(self, subject: tuple[Any, ...], notice: Notice, proof: bool = False) -> Result:
        """Return the presented result of a study of the arguments from `prepare`; proof: whether to use `prove`."""
        study = self.studying(proof)
        if self.doing is None:
            return self.present(*subject, study(*subject))
        doing = self.doing

        def notify(done: int, total: int, what: str) -> None:
            notice(done, total, doing.format(what) if what else "flown")

        return self.present(*subject, study(*subject, notify))


def names() -> list[str]:
    """Return the names of the commands."""
    return [item.name.replace("_", "-") for item in iter_modules(__path__)]


def command(name: str) -> Command:
    """Return the command of this name."""
    return import_module(f"{__name__}.{name.replace('-', '_')}").COMMAND
