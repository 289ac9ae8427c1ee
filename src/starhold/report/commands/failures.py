"""The command `failures`, the control authority after the loss of any one or two wheels."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from starhold.report.commands import Column, Command, Result, Table, later

if TYPE_CHECKING:
    from starhold.scenario.reading import LawEntry, Scenario
    from starhold.studies.failures import Failure


def present(scenario: Scenario, entry: LawEntry, failures: Sequence[Failure]) -> Result:
    """Return the result: a row per loss, then what is lost without which wheels, and the gains that were redesigned."""
    from starhold.laws.modes import mode_laws
    from starhold.report.text import number_text

    flown = [(failure.name, failure.gains) for failure in failures if failure.gains is not None]
    sentences: list[str] = []
    for failure in failures:
        if not failure.controllable:
            sentences.append(f"without {failure.name}: no control torque remains about {_directions(failure)}")
    sentences += [f"without {failure.name} not flown: {failure.refused}" for failure in failures if failure.refused]
    if any(failure.certified is not None for failure in failures):
        sentences.append("certified: slews from rest for which it is proved that no motor or wheel reaches its limit.")
    sentences += [
        f"lost {failure.name}: {failure.proof.sentence}" for failure in failures if failure.proof and failure.flown
    ]
    if mode_laws(entry.law, entry.gains) and any(failure.flown and failure.settling is None for failure in failures):
        sentences.append(
            "not settled: judged at the end of the flight, for the target of the mode active then; to judge a single mode, "
            "give it as a [[law]] of its own and name it by --law."
        )
    texts = {name: [number_text(gains[name], 4) for _, gains in flown] for name in flown[0][1]}
    # The number of losses until the mode for them begins is not a gain.
    changed = [name for name, every in texts.items() if len({*every}) > 1 and name != "wheels_lost"]
    for name in changed:
        lost = {
            text: [case for (case, _), other in zip(flown, texts[name], strict=True) if other == text]
            for text in texts[name]
        }
        sentences.append(f"{name}: {', '.join(f'{text} {_cases(names)}' for text, names in lost.items())}")
    if not changed:
        sentences.append("The gains are the same in all of them.")
    if any(failure.saturation is not None and failure.saturation.known == "extrapolated" for failure in failures):
        sentences.append("~ extrapolated from the growth of the momentum late in the flight.")
    title = f"{scenario.name}, {entry.name}: loss of wheels"
    return Result(title, ["", _table(failures), *sentences], _numbers(failures, entry), lambda: draw(failures, title))


def _numbers(failures: Sequence[Failure], entry: LawEntry) -> Table:
    """Return all numbers, with every gain."""
    gains = [Column(item.name, item.gain.unit) for item in entry.law.fields()]
    rows = [[*_cells(failure).values(), *((failure.gains or {}).get(gain.name) for gain in gains)] for failure in failures]
    return Table([*_cells(failures[0]), *gains], rows)


def _cells(failure: Failure) -> dict[Any, Any]:
    from starhold.report.tables import cell

    known = failure.saturation
    certified, proof = failure.certified or (None, None), failure.proof
    proved: dict[Any, Any] = {}
    if proof is not None:
        proved = {Column("proved angle", "rad"): proof.angle, Column("proved after", "s"): proof.settling}
        proved |= {Column("proved share of orbits"): proof.share, Column("not in the proof"): "; ".join(proof.left_out)}
    return {
        Column("lost wheels"): failure.lost,
        Column("controllable axes"): 3 - len(failure.lacking),
        Column("directions without authority"): "; ".join(map(cell, failure.lacking)),
        Column("condition number"): failure.condition,
        Column("torque authority", "N m"): failure.authority,
        Column("share of intact authority"): failure.share,
        Column("degree of stability intact", "1/s"): failure.eta_intact,
        Column("degree of stability after", "1/s"): failure.eta,
        Column("settling time", "s"): failure.settling,
        Column("diverged at", "s"): failure.diverged_at,
        Column("certified turn", "rad"): certified[0],
        Column("certified rate", "rad/s"): certified[1],
        Column("saturation time", "s"): known and known.time,
        Column("saturating wheel"): known and known.wheel,
        Column("saturation known from"): known and known.known,
        Column("window of momentum growth", "s"): known and known.window,
        Column("largest share of momentum limit"): failure.momentum_share,
        Column("time flown", "s"): failure.flown,
        Column("not flown because"): failure.refused,
        **proved,
    }


def _table(failures: Sequence[Failure]) -> Table:
    """Return what tells whether a loss is survived, narrow enough for a small screen; all else is in the file."""
    columns = [Column("lost"), Column("axes", "left", ">"), Column("authority", "N m", ".4g"), Column("share", "%", ".1f")]
    columns += [Column("certified", "turn, °", ">"), Column("settling", "s", ".4g"), Column("wheel full", "min", ">")]
    columns += [Column("proved", "within, °", ">")] * (failures[0].proof is not None)
    return Table(columns, [[failure.name, *_row(failure), *_proved(failure)] for failure in failures])


def _cases(names: Sequence[str]) -> str:
    """Return losses of these names as text."""
    lost = [name for name in names if name != "none"]
    listed = " or ".join([", ".join(lost[:-1]), *lost[-1:]][len(lost) < 2 :])
    return " and ".join(["with all wheels"] * (len(lost) < len(names)) + [f"without {listed}"] * bool(lost))


def _proved(failure: Failure) -> list[str | None]:
    from starhold.certification.rounding import shown

    proof = failure.proof
    return [] if proof is None else [None if proof.angle is None else shown(math.degrees(proof.angle), up=True)]


def _row(failure: Failure) -> list[Any]:
    from starhold.certification.rounding import shown

    axes = str(3 - len(failure.lacking))
    begun = [axes if failure.controllable else f"[red]{axes}[/red]", failure.authority, 100.0 * failure.share]
    if failure.gains is None:
        return [*begun, None, None, None]
    certified = None if failure.certified is None else shown(math.degrees(failure.certified[0]))
    settling = "not settled" if failure.settling is None else failure.settling
    if failure.diverged_at is not None:
        settling = f"[red]diverged at {failure.diverged_at:.4g}[/red]"
    return [*begun, certified, settling, _full(failure)]


def _full(failure: Failure) -> str | None:
    from starhold.studies.failures import HORIZON

    known: Any = failure.saturation
    if known is None:
        return None
    if known.time is None:
        return f"> {HORIZON} orbits" if failure.orbit else f"> {HORIZON * known.window / 60.0:.4g}"
    return f"{'~' if known.known == 'extrapolated' else ''}{known.time / 60.0:.4g} (wheel {known.wheel})"


def _directions(failure: Failure) -> str:
    """Return the body directions without authority as text."""
    if len(failure.lacking) == 3:
        return "any axis"
    return " and ".join(f"({', '.join(f'{x:.3g}' for x in direction)})" for direction in failure.lacking)


def draw(failures: Sequence[Failure], title: str) -> Any:
    """Return a figure with a row per loss and a panel per quantity."""
    from starhold.certification.rounding import shown
    from starhold.report.bars import draw_bars

    panels = [_bars("authority left, % of intact", failures, [100.0 * failure.share for failure in failures])]
    if any(failure.eta is not None for failure in failures):
        panels.append(_bars("degree of stability, 1/s", failures, [failure.eta for failure in failures]))
    panels.append(_bars("settling time, s", failures, [failure.settling for failure in failures]))
    if any(failure.certified is not None for failure in failures):
        turns = [None if f.certified is None else math.degrees(f.certified[0]) for f in failures]
        panels.append(_bars("certified turn, °", failures, turns, "not proved", shown))
    if any(failure.proof is not None for failure in failures):
        angles = [None if f.proof is None or f.proof.angle is None else math.degrees(f.proof.angle) for f in failures]
        panels.append(_bars("proved within, °", failures, angles, "not proved", partial(shown, up=True)))
    rows, hues = [failure.name for failure in failures], [0 if failure.lost else 2 for failure in failures]
    struck = {k: f"no torque about {_directions(failure)}" for k, failure in enumerate(failures) if not failure.controllable}
    kinds = {"intact": 2, "three axes left": 0}
    return draw_bars(title, "", rows, hues, panels, kinds, "as intact", "lost wheels", struck, "an axis without torque")


def _bars(
    label: str,
    failures: Sequence[Failure],
    values: Sequence[float | None],
    missing: str = "not settled",
    text: Callable[[float], str] = "{:.3g}".format,
) -> Any:
    """Return a panel with the number at the end of each bar, as `text` writes it, or the reason why there is none."""
    from starhold.report.bars import Bars

    lost = ["diverged" if f.diverged_at is not None else "not flown" if f.refused else missing for f in failures]
    words = [why if value is None else text(value) for value, why in zip(values, lost, strict=True)]
    return Bars(label, [value or 0.0 for value in values], words, values[0])


COMMAND = Command(
    "Show the control authority after the loss of any one or two wheels: a table, failures.csv and failures.png.",
    "failures",
    later("studies.failures.study"),
    present,
    later("studies.failures.pick"),
    doing="lost: {}",
    prove=later("studies.failures.study", proof=True),
)
