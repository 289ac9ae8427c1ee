"""The gallery: scripts of `examples` with the pictures that they draw."""

from __future__ import annotations

import ast
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"
SCRIPTS = (
    "own_spacecraft",
    "own_law",
    "own_part",
    "sweep",
    "certificate",
    "wheel_failure",
    "campaign",
    "libration_point",
)
HEAD = """# Gallery

Scripts to start from. Each lies in the folder `examples`, runs as `python examples/NAME.py PICTURE.png`, and is run by the
tests, which compare what it draws with what is shown here. In a notebook, leave out the last line.
"""


def page() -> str:
    """Each script with its title, what its docstring says, its picture and its text."""
    lines = [HEAD]
    for name in SCRIPTS:
        text = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
        title, _, told = (ast.get_docstring(ast.parse(text)) or "").partition("\n\n")
        code = text.partition('"""\n\n')[2].rstrip()
        lines += [f"## {title}", "", " ".join(told.split()), "", f"![{title}](gallery/{name}.png)", ""]
        lines += [f"`examples/{name}.py`:", "", "```python", code, "```", ""]
    return "\n".join(lines)
