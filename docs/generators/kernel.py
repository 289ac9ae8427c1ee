"""The table of the kernel's files in the order of reading."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from generators.tables import table
from starhold import kernel

FIRST = ("numbers", "polynomials", "programs", "rules", "reading", "sentences", "check", "loops", "points", "cells")


def files_table() -> str:
    """The files, each after those that it imports, with their lines."""
    folder = Path(kernel.__file__).parent
    found = [folder / f"{name}.py" for name in FIRST]
    found += sorted(path for path in folder.rglob("*.py") if path not in found)
    rows: list[list[str]] = []
    for path in found:
        text = path.read_text(encoding="utf-8")
        purpose = re.split(r"(?<=\.)\s", ast.get_docstring(ast.parse(text)) or "")[0].replace("\n", " ")
        rows.append([f"`{path.relative_to(folder).as_posix()}`", str(len(text.splitlines())), purpose])
    rows.append(["all", str(sum(int(lines) for _, lines, _ in rows)), ""])
    return table(["file", "lines", "about"], rows)
