"""The table of what Rocq accepts of the built-in scenarios and invariant sets. Run it to prove them anew and have coqc
accept them, all or those that are named."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import starhold as sh
from generators.tables import table
from starhold.certification import invariant
from starhold.certification.certificate import FILE, write
from starhold.report.results import write_lemmas
from starhold.scenario.building import build
from starhold.scenario.reading import builtin_names
from starhold.studies.body import study_of

STORED = Path(__file__).with_name("lemmas.json")
"""By example and file the number of lemmas, and the processor's seconds and the memory (MiB) that coqc took."""
COUNTED = "\nLemma claim"


def names() -> list[str]:
    """List the scenarios and the invariant sets."""
    return [*builtin_names(), *invariant.builtin_names()]


def certify(name: str, folder: Path) -> list[Path]:
    """Write all that is proved of an example, as `certify --rocq` and `invariant --rocq` do; return the files of lemmas."""
    if name in invariant.builtin_names():
        invariant.write(invariant.certify(invariant.load(name)), folder / FILE)
    else:
        scenario = sh.load(name)
        study = study_of(scenario.body)
        loops = [(entry, build(scenario, entry)) for entry in scenario.laws]
        issued = [one for entry, loop in loops for one in study.certify(scenario, entry, loop, pointing=True)]
        write([one.certificate for one in issued], name, folder / FILE)
    return write_lemmas(folder)


def refusal(path: Path, *options: str) -> tuple[str, float, float]:
    """Return what coqc says of a file, nothing where it accepts all of it, and the processor's seconds and MiB it takes."""
    with tempfile.TemporaryFile("w+") as said:
        started = subprocess.Popen(["coqc", *options, path.name], cwd=path.parent, stdout=said, stderr=said)
        _, status, used = os.wait4(started.pid, 0)
        started.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        told = said.read() or "coqc failed" * (started.returncode != 0)
    return told, used.ru_utime, used.ru_maxrss / 1024


def accepted(folder: Path, paths: list[Path]) -> dict[str, Any]:
    """Have coqc accept files of lemmas; ValueError where it does not."""
    found = dict[str, Any]()
    for path in paths:
        told, seconds, memory = refusal(path)
        if told:
            raise ValueError(f"{path.relative_to(folder)}: {told}")
        count = path.read_text(encoding="utf-8").count(COUNTED)
        found[path.name] = {"lemmas": count, "seconds": round(seconds, 1), "memory": round(memory)}
    return found


def lemmas_table() -> str:
    """Every file with its lemmas and what coqc takes for it, and their sum."""
    rows, sums = list[list[str]](), [0, 0.0, 0]
    for name, files in json.loads(STORED.read_text(encoding="utf-8")).items():
        for k, (file, of) in enumerate(files.items()):
            rows.append([f"`{name}`" * (k == 0), f"`{file}`", f"{of['lemmas']}", f"{of['seconds']:.1f}", f"{of['memory']}"])
            sums = [sums[0] + of["lemmas"], sums[1] + of["seconds"], max(sums[2], of["memory"])]
    rows.append(["all", f"{len(rows)} files", f"{sums[0]}", f"{sums[1]:.0f}", f"at most {sums[2]}"])
    return table(["example", "file", "lemmas", "seconds", "MiB"], rows)


if __name__ == "__main__":
    stored: dict[str, Any] = json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}
    for wanted in sys.argv[1:] or names():
        with tempfile.TemporaryDirectory() as made:
            stored[wanted] = accepted(Path(made), certify(wanted, Path(made)))
        kept = {name: stored[name] for name in names() if name in stored}
        STORED.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
