"""The tables of the kernel's files in the order of reading, and of what each claim needs of them."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

from generators.tables import table
from starhold import kernel
from starhold.kernel.theorems import THEOREMS

CORE = ("numbers", "polynomials", "programs", "rules", "reading", "sentences", "check", "theorems")
"""What every check loads."""
FIRST = (*CORE[:-1], "loops", "points", "cells")


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


def needed_table() -> str:
    """The theorems by file, with the lines of the kernel that Python loads to check their claims."""
    folder, files = Path(kernel.__file__).parent, dict[str, list[str]]()
    for name, theorem in THEOREMS.items():
        files.setdefault(theorem.args[0], []).append(name)
    rows: list[list[str]] = []
    for file, names in files.items():
        run = f"import sys; sys.path.insert(0, {str(folder.parent)!r}); import kernel.check, kernel.theorems.{file}; "
        said = subprocess.check_output([sys.executable, "-I", "-S", "-c", run + "print(kernel.check.audited())"], text=True)
        count, others = re.fullmatch(r"Checked by (\d+) lines of the kernel: (.*)\.\n", said).groups()
        beside = [f"`{one}`" for one in others.split(", ") if one not in CORE and one != f"theorems.{file}"]
        rows.append([f"`{file}`: {', '.join(names)}", count, ", ".join(beside)])
    return table(["theorems", "lines", "files beside the core and its own"], rows)
