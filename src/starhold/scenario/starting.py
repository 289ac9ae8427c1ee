"""Checks estimators that are initialized by another estimator."""

from starhold.errors import InputError
from starhold.loop.closed_loop import ClosedLoop
from starhold.parts.catalogue import parts
from starhold.parts.contract import IS_VALID
from starhold.scenario.checking import nearest, show


def check_starts(loop: ClosedLoop, where: str) -> None:
    """Raise InputError where an estimator cannot be initialized by the estimator that it names."""
    there = {fitted.called: fitted for fitted in loop.estimating}
    for one in loop.estimating:
        if not one.started_by:
            continue
        key = f"part {one.called}: started_by"
        others = [name for name in there if name != one.called]
        if not one.part.flag("STARTABLE"):
            known = [name for name, part in parts("estimator").items() if part.flag("STARTABLE")]
            raise InputError(where, key, f"{one.part.name}, which no other starts", f"a {' or '.join(known)}")
        if one.started_by not in others:
            allowed = nearest(one.started_by, others) if others else "the name of another estimator, which watches"
            raise InputError(where, key, show(one.started_by), allowed)
        lacking = [name for name in ("attitude", IS_VALID) if name not in there[one.started_by].part.module.Estimate._fields]
        if lacking:
            raise InputError(where, key, f"{one.started_by}, which gives no {lacking[0]}", "an estimator that gives it")
        seen, then = [one.called], one.started_by
        while then and then not in seen:
            seen, then = [*seen, then], there[then].started_by if then in there else ""
        if then:
            raise InputError(where, key, f"{' started by '.join([*seen, then])}", "an estimator that begins by itself")
