"""The table of what is published and proved of the invariant sets that come with starhold. Run it to prove them anew."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from generators.tables import table
from starhold.certification.invariant import InvariantProblem, builtin_names, certify, load
from starhold.certification.invariant.wording import HEADINGS, down

STORED = Path(__file__).with_name("sets.json")
"""For each example the levels of its claims, None for claims without one, and the seconds that the proofs took."""


def proved(name: str) -> dict[str, Any]:
    """The levels that are proved now, and how long that takes."""
    start = time.perf_counter()
    certificate = certify(load(name))
    if certificate.outcome != "proved":
        raise ValueError(f"{name} is {certificate.outcome}")
    levels = [claim.numbers.get("level") for claim in certificate.claims]
    return {"levels": levels, "seconds": round(time.perf_counter() - start, 1)}


def sets_table() -> str:
    """Every claim of the examples with its published and stored level, the time once for each example."""
    rows: list[list[str]] = []
    for name, stored in json.loads(STORED.read_text(encoding="utf-8")).items():
        problem: InvariantProblem = load(name)
        for k, (wanted, level) in enumerate(zip(problem.claims, stored["levels"], strict=True)):
            published = "" if wanted.published is None else f"{wanted.published:.6g}"
            seconds = "" if k else f"{stored['seconds']:g}"
            shown = "yes" if level is None else down(level)
            rows.append([f"`{name}`" * (k == 0), wanted.name, HEADINGS[wanted.theorem], published, shown, seconds])
    return table(["example", "claim", "what", "published level", "proved", "seconds"], rows)


if __name__ == "__main__":
    STORED.write_text(json.dumps({name: proved(name) for name in builtin_names()}, indent=1) + "\n", encoding="utf-8")
