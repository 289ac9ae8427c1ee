"""Reads `paper.toml`, which lists what a publication prints, item by item, and the measure of each item."""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from starhold.errors import InputError, expect
from starhold.publications.verdicts import PLAIN, Printed, Verdict

PAPERS = ("A", "B", "C", "D", "E")


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class Item(_Strict):
    """An item made by a measure: the name of the function, in a module of the paper's folder or in the common one, and its
    arguments besides the desk."""

    by: str
    given: dict[str, Any] = Field(default_factory=dict, alias="with")


class FigureItem(Item):
    """A figure: its number in the publication ("" for an additional one), its caption, and the point that it shows."""

    number: str = ""
    name: str
    """The name of its file."""
    caption: str
    seen: str = ""
    after: str = ""
    """The number of the published figure after which an additional one comes."""


class Row(Item):
    """A printed number or a statement."""

    name: str
    where: str
    """Its place in the publication: a section, equation, figure or table."""
    says: str
    published: tuple[str, ...] = ()
    """The printed numbers, with all their digits; empty where a statement is judged."""
    unit: str = ""
    tolerance: float = 0.0
    """The relative difference from the printed number up to which ours counts as close."""
    verdict: Verdict
    """The expected verdict."""
    why: str = ""
    """The explanation of a verdict other than agreement."""
    erratum: int | None = None
    """The number of the erratum that the row shows, if any."""

    @field_validator("published", mode="before")
    @classmethod
    def _several(cls, value: Any) -> Any:
        return (value,) if isinstance(value, str) else value

    @model_validator(mode="after")
    def _explained(self) -> Row:
        if self.verdict not in PLAIN and not self.why:
            raise ValueError(f"{self.name}: a verdict of {self.verdict!r} needs a `why`")
        numbers = ("agrees", "close", "differs")
        if (self.verdict in numbers) != bool(self.published):
            raise ValueError(f"{self.name}: {self.verdict!r} goes with {'no' if self.published else 'a'} printed number")
        return self

    @property
    def printed(self) -> list[Printed]:
        """The printed numbers in parsed form."""
        return [Printed.read(text) for text in self.published]


class Section(_Strict):
    """A heading, a few words, and the figures and rows under it."""

    title: str
    text: str = ""
    figure: tuple[FigureItem, ...] = ()
    row: tuple[Row, ...] = ()


class Paper(_Strict):
    """A publication, with a description of its source."""

    letter: str
    title: str
    source: str
    about: str
    section: tuple[Section, ...]

    @model_validator(mode="after")
    def _no_two_alike(self) -> Paper:
        for names in ([row.name for row in self.rows], [figure.name for figure in self.figures]):
            twice = {name for name in names if names.count(name) > 1}
            if twice:
                raise ValueError(f"paper {self.letter}: twice {sorted(twice)}")
        return self

    @property
    def rows(self) -> list[Row]:
        """All rows in their order."""
        return [row for section in self.section for row in section.row]

    @property
    def figures(self) -> list[FigureItem]:
        """All figures in their order."""
        return [figure for section in self.section for figure in section.figure]


def papers_of(word: str) -> list[str]:
    """Return the letters that a word on the command line stands for. InputError unless it is a letter or "all"."""
    return list(PAPERS) if word.lower() == "all" else [paper_of(word, " or all")]


def paper_of(word: str, or_else: str = "") -> str:
    """Return the letter of a publication, in upper case. InputError, which lists the allowed words, for anything else."""
    expect(word, str, "reproduce", f"{', '.join(PAPERS)}{or_else}")
    if word.upper() not in PAPERS:
        raise InputError("reproduce", "publication", word, f"{', '.join(PAPERS)}{or_else}")
    return word.upper()


def folder_of(letter: str) -> Any:
    """Return the folder of a publication."""
    return resources.files("starhold.publications.papers") / letter


def read_paper(letter: str) -> Paper:
    """Return the publication of a letter."""
    return Paper.model_validate(tomllib.loads((folder_of(letter) / "paper.toml").read_text(encoding="utf-8")))


def scenario_files(letter: str) -> dict[str, str]:
    """Return the texts of a publication's scenario files, by their names without suffix."""
    files = {item.name: item for item in folder_of(letter).iterdir() if item.name.endswith(".toml")}
    return {
        name.removesuffix(".toml"): files[name].read_text(encoding="utf-8") for name in sorted(files) if name != "paper.toml"
    }
