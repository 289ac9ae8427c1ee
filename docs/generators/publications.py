"""Writes the page on the publications that `starhold reproduce` reproduces."""

from __future__ import annotations

from collections import Counter

from generators.tables import table
from starhold.publications.paper import PAPERS, read_paper
from starhold.publications.verdicts import VERDICTS

HEAD = """# The publications, reproduced

starhold implements the methods of five publications. One command reproduces each of their figures, tables and statements
that can be checked and compares it with the printed one:

```
starhold reproduce all -o published   # or one of A to E; needs the extra `campaign`
```

`published/index.html` leads to a page for each publication, which opens offline, with every figure and the rows *printed,
ours, difference, verdict*; `summary.json` has the rows for programs, and the folders `A` to `E` contain the flown scenario
files. The command ends with exit code 1 if a verdict differs from the recorded one, so that a change of the code that
changes a result is noticed. From Python, `sh.reproduce("D")` gives the rows and the curves.

Verdicts are computed from the measured values and the printed digits:
"""

TAIL = """
`src/starhold/publications/papers/LETTER/paper.toml` lists the statements of a publication, row by row, with their measures;
scenario files are in the same folder, and modules for everything else. Only the texts of the publications were available,
not their pictures: figures are compared with their descriptions in the text.
"""


def page() -> str:
    """Return the page: verdicts and their meanings, the publications with the recorded verdicts, all errata."""
    papers = [read_paper(letter) for letter in PAPERS]
    lines = [HEAD, table(["verdict", "meaning"], [[word, meaning] for word, meaning in VERDICTS.items()]), ""]
    rows: list[list[str]] = []
    for paper in papers:
        counted = Counter(row.verdict for row in paper.rows)
        told = ", ".join(f"{counted[verdict]} {verdict}" for verdict in VERDICTS if counted[verdict])
        rows.append([paper.letter, f"{paper.title}. {paper.source}", str(len(paper.figures)), str(len(paper.rows)), told])
    lines += ["## Publications", "", table(["", "publication", "figures", "rows", "verdicts"], rows), ""]
    errata = sorted(
        (row.erratum, f"{paper.letter}, {row.where}", row.says, row.why)
        for paper in papers
        for row in paper.rows
        if row.erratum is not None
    )
    cells = [[str(number), *texts] for number, *texts in errata]
    lines += ["## Errata", "", table(["no.", "where", "printed", "corrected"], cells), TAIL]
    return "\n".join(lines)
