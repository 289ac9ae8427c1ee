"""Reads the gains of a law's table, given as they are or designed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from starhold.laws.catalogue import Law
from starhold.parts.part import Fitted
from starhold.scenario.checking import make_gains, pick_law, refuse_unstable, refusing, validate
from starhold.scenario.schema import LawTable, law_model

if TYPE_CHECKING:
    from starhold.scenario.reading import Scenario


class Read(NamedTuple):
    """A law's table read: the law, the design form and its inputs (None where the gains are given), and the gains."""

    law: Law
    form: str | None
    table: Any
    spec: Any
    gains: Any
    targets: tuple[Fitted, ...] = ()
    """Of a law of modes that have targets of their own, one each."""


def read_gains(
    data: Any, scenario: Scenario, context: Any, key: str, base: type[LawTable] | None = None, shared: Any = None
) -> Read:
    """The law of a raw table, called `key` in errors, for a scenario that as yet has none. base: what such tables have
    beside the gains, by default that of the body; shared: the table, read already, that holds a body's own keys in its
    place."""
    body, where, craft = scenario.hooks, scenario.where, scenario.craft
    found, law, form = pick_law(data, body.laws(), body.name, scenario.folder, where, key)
    extra = ["file", *(["form"] if law.forms else [])]
    own = validate(law_model(law, form, base or body.law_table), found, where, key, extra, context)
    values = [getattr(own, item.name) for item in law.fields(form)]
    with refusing(law, where, key):
        spec = None if form is None else body.complete(scenario, law, law.forms[form](*values), shared or own)
    gains = make_gains(law, values, spec, craft, where, key)
    if not scenario.allow_unstable:
        refuse_unstable(lambda: law.check(gains, craft), where, key)
    return Read(law, form, own, spec, gains)
