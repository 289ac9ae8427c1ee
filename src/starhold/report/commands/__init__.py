"""Commands that study one law of a scenario: each is a file of this folder, with its name and a `COMMAND`. The command line,
the Python interface and the studio offer whatever stands here, and present its `Result`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario


class Column(NamedTuple):
    """A column of a table: its heading, the unit below it, and the format of what stands at the right; else it is words."""

    name: str
    unit: str = ""
    format: str = ""


class Table(NamedTuple):
    """Columns and rows. A cell is a number, several of them, words or None for nothing; bold and ends are the numbers of
    rows that stand out and of those that a line follows."""

    columns: Sequence[Column]
    rows: Sequence[Sequence[Any]]
    title: str = ""
    bold: Collection[int] = ()
    ends: Collection[int] = ()

    def heads(self) -> list[str]:
        """The headings, each with its unit."""
        return [f"{column.name} ({column.unit})" if column.unit else column.name for column in self.columns]

    def texts(self) -> list[list[str]]:
        """The cells for reading; what is nothing is a dash, and words keep their marks of style."""
        return [
            [
                value if isinstance(value, str) else "—" if value is None else format(value, column.format)
                for value, column in zip(row, self.columns, strict=True)
            ]
            for row in self.rows
        ]


class Result(NamedTuple):
    """A study gives this. numbers: all that it computed, SI and radians, for a file. figure: makes the figure with the
    plotting library. table and sentences: for reading. summary: for summary.json, None without that file. met: whether all
    that is required is met."""

    title: str
    numbers: Table
    figure: Callable[[], Any]
    table: Table
    sentences: Sequence[str] = ()
    summary: Mapping[str, Any] | None = None
    met: bool = True


class Option(NamedTuple):
    """An option that stands in place of a key of the scenario: a whole number if `whole`, else a time."""

    key: str
    help: str
    whole: bool = False


def later(path: str) -> Callable[..., Any]:
    """The function of a path below starhold, whose module is loaded when it is called."""
    module, _, name = path.rpartition(".")
    return lambda *given: getattr(import_module(f"starhold.{module}"), name)(*given)


def _named(scenario: Scenario, law: str | None) -> LawEntry:
    return scenario.pick(law)


class Command(NamedTuple):
    """A study of one law of a rigid body.

    summary: what it does, in a sentence. suffix: results go to SCENARIO-suffix. study: computes, from a scenario, a law and
    a notice, which hears the number done, that of all and what comes next ("" at the end). present: the Result of
    these and what was computed. pick: the law that a name or None means, with InputError for what cannot be studied. law:
    help for --law. doing: what stands beside the bar of progress. unstable: whether there is --allow-unstable.
    """

    summary: str
    suffix: str
    study: Callable[..., Any]
    present: Callable[[Scenario, LawEntry, Any], Result]
    pick: Callable[[Scenario, str | None], LawEntry] = _named
    law: str = "which law of the file; the first if not given"
    doing: str = "{}"
    options: Mapping[str, Option] = {}
    unstable: bool = False

    def prepare(self, scenario: Scenario, law: str | None = None, **given: Any) -> tuple[Scenario, LawEntry]:
        """The scenario with what options say, and the law."""
        scenario = scenario.about("rigid-body")
        if given:
            scenario = scenario.with_({self.options[name].key: value for name, value in given.items()})
        return scenario, self.pick(scenario, law)

    def result(self, scenario: Scenario, entry: LawEntry, notice: Callable[[int, int, str], None]) -> Result:
        """Study a law, and present what is found."""

        def told(done: int, total: int, what: str) -> None:
            notice(done, total, self.doing.format(what) if what else "flown")

        return self.present(scenario, entry, self.study(scenario, entry, told))


def names() -> list[str]:
    """The names of the commands."""
    return [item.name.replace("_", "-") for item in iter_modules(__path__)]


def command(name: str) -> Command:
    """The command of a name."""
    return import_module(f"{__name__}.{name.replace('-', '_')}").COMMAND
