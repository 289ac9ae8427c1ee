"""The page of what `make bench` measured last."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from generators.tables import table

STORED = Path(__file__).with_name("benchmarks.json")


def page() -> str:
    """The page: machine and versions, then the tables of each script."""
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    versions = ", ".join(f"{name} {version}" for name, version in stored["versions"].items())
    lines = [
        "# Benchmarks",
        "",
        f"Measured by `make bench` in {stored['seconds']} s on {stored['date']}: {stored['machine']}; {versions}.",
        "",
        "Only ratios within one table mean anything: what stands in it took turns on the same machine.",
        "",
    ]
    missed = [f"* `{name}.py`: {line}" for name, entry in stored["scripts"].items() for line in entry["missed"]]
    lines += ["## Goals that are missed", "", *(missed or ["None."]), ""]
    for name, entry in stored["scripts"].items():
        lines += [f"## `{name}.py`", "", entry["about"], "", *(line for block in entry["blocks"] for line in _block(block))]
    return "\n".join(lines).rstrip() + "\n"


def _block(block: dict[str, Any]) -> list[str]:
    return [block["text"], ""] if "text" in block else [table(block["heads"], block["rows"]), ""]
