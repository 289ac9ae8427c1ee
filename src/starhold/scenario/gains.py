"""The gains of a law's table are read, given as they are or designed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from starhold.laws.catalogue import Law
from starhold.parts.part import Fitted
from starhold.scenario.checking import make_gains, pick_law, refuse_unstable, refusing, validate
from starhold.scenario.schema import LawTable, law_model
from starhold.scenario.shared import refuse_own, values_of

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
    """The targets of a law's modes where these have their own, one each."""


def read_gains(
    data: Any, scenario: Scenario, context: Any, key: str, base: type[LawTable] | None = None, whole: Any = None
) -> Read:
    """The law of a raw table, called `key` in errors, for a scenario that as yet has none. base: the keys of such tables
    beside the gains, by default those of the body; whole: the table, read already, that holds a body's own keys in its
    place."""
    body, where, craft = scenario.hooks, scenario.where, scenario.craft
    table, law, form = pick_law(data, body.laws(), body.name, scenario.folder, where, key)
    declared, shared = law.fields(form), scenario.table.shared
    refuse_own(table, declared, shared, where, key)
    extra = ["file", *(["form"] if law.forms else [])]
    validated = validate(law_model(law, form, base or body.law_table, tuple(shared)), table, where, key, extra, context)
    values = list(values_of(declared, validated, shared).values())
    with refusing(law, where, key):
        spec = None if form is None else body.complete(scenario, law, law.forms[form](*values), whole or validated)
    gains = make_gains(law, values, spec, craft, where, key)
    if not scenario.allow_unstable:
        refuse_unstable(lambda: law.check(gains, craft), where, key)
    return Read(law, form, validated, spec, gains)
