"""Runs every benchmark, and writes what they print as one JSON file, from which the page of the documentation is made."""

from __future__ import annotations

import argparse
import ast
import datetime
import json
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
STORED = HERE.parent / "docs" / "generators" / "benchmarks.json"
SCRIPTS: dict[str, tuple[str, ...]] = {
    "steps": (),
    "peak": (),
    "sharing": (),
    "cubesat": (),
    "wheels": (),
    "stepper": (),
    "law_cost": (),
    "mpc": (),
    "modal_roots": (),
    "station": (),
    "certify": (),
    "campaign": ("--quick",),
    "cli": (),
}
"""Scripts in the order of the page, with their arguments; `peer.py` needs another version of the tree and is left out."""
RULE = re.compile(r"-+(?:  -+)*")


def read(lines: list[str]) -> list[dict[str, Any]]:
    """What a script printed: sentences, and tables (see `common.show`), whose columns are as wide as their rules."""
    blocks: list[dict[str, Any]] = []
    rest = iter(enumerate(lines))
    for i, line in rest:
        if i + 1 < len(lines) and RULE.fullmatch(lines[i + 1]):
            ends = [match.span() for match in re.finditer("-+", lines[i + 1])]
            rows = []
            next(rest)
            for _, row in rest:
                if not row.strip():
                    break
                rows.append([row[a:b].strip() for a, b in ends])
            blocks.append({"heads": [line[a:b].strip() for a, b in ends], "rows": rows})
        elif line.strip():
            blocks.append({"text": line.strip()})
    return blocks


def measure(name: str, arguments: tuple[str, ...]) -> tuple[str, str, dict[str, Any]]:
    """Run a script; return the machine, the versions, and its entry. SystemExit with what it printed where it fails."""
    path = HERE / f"{name}.py"
    print(f"== {path.name} {' '.join(arguments)}", flush=True)
    begun = time.perf_counter()
    run = subprocess.run([sys.executable, str(path), *arguments], capture_output=True, text=True, check=False)
    print(run.stdout, flush=True)
    if run.returncode:
        raise SystemExit(f"{path.name} failed:\n{run.stderr[-3000:]}")
    machine, versions, *lines = run.stdout.splitlines()
    about = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n\n")[0]
    missed = [line.strip() for line in lines if "MISSES" in line]
    seconds = round(time.perf_counter() - begun, 1)
    return machine, versions, {"about": " ".join(about.split()), "seconds": seconds, "missed": missed, "blocks": read(lines)}


def main() -> None:
    """Run the scripts named, or all of them, and store what they measured."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scripts", nargs="*", choices=[*SCRIPTS, []], help="run these alone and store nothing")
    chosen = parser.parse_args().scripts
    entries: dict[str, Any] = {}
    versions: dict[str, str] = {}
    machine = ""
    for name in chosen or SCRIPTS:
        machine, line, entries[name] = measure(name, SCRIPTS[name])
        versions |= dict(part.rsplit(" ", 1) for part in line.split(", "))
    total = sum(entry["seconds"] for entry in entries.values())
    for name, entry in entries.items():
        for line in entry["missed"]:
            print(f"{name}: {line}")
    if not chosen:
        today = datetime.date.today().isoformat()
        whole = {"date": today, "machine": machine, "versions": versions, "seconds": round(total), "scripts": entries}
        STORED.write_text(json.dumps(whole, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        print(f"{total:.0f} s in all, in {STORED.relative_to(HERE.parent)}: `make docs` makes the page of it")


if __name__ == "__main__":
    main()
