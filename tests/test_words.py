"""Docstrings begin with a sentence that stands by itself, names say what a value is, and tests stand alone."""

import ast
import re
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "starhold"
FRAGMENT = re.compile(r"(What|The same|Of)\b")
"""Beginnings that need the name above, or the docstring before, to be understood."""

BARE = {"told", "found", "own", "held", "asked"}
"""Names that hide whether a value is a measurement, a bound, a command or a result."""


def files_of(place):
    return sorted(place.rglob("*.py")) if place.is_dir() else [place]


FIELDS = {ast.Name: "id", ast.arg: "arg", ast.keyword: "arg", ast.Attribute: "attr", ast.alias: "name"}
"""Where nodes that only name something keep the name."""


def faults(path):
    """Line and text of the docstrings of a file's module, classes and functions that are fragments, and the bare names of
    variables, arguments, attributes, keywords, functions and classes."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        name = getattr(node, FIELDS.get(type(node), "name"), None)
        if isinstance(name, str) and name in BARE:
            yield f"{getattr(node, 'lineno', 0)}: {name}"
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            text = ast.get_docstring(node) or ""
            if FRAGMENT.match(text):
                yield f"{node.body[0].lineno}: {text.splitlines()[0]}"


@pytest.mark.parametrize("folder", sorted({path.relative_to(SOURCE).parts[0] for path in SOURCE.rglob("*.py")}))
def test_docstrings_begin_with_a_sentence_and_names_say_what_a_value_is(folder):
    files = files_of(SOURCE / folder)
    assert [f"{path.relative_to(SOURCE)}:{fault}" for path in files for fault in faults(path)] == []


def test_a_fragment_and_bare_names_are_found(tmp_path):
    """In every place that may hold one."""
    path = tmp_path / "wrong.py"
    path.write_text('''def held(own, *told):
    """What it gives."""
    found = 1
    own.asked = f(told=1)
    try:
        pass
    except E as own:
        pass
''')
    there = ["1: held", "1: own", "1: told", "2: What it gives.", "3: found", "4: asked", "4: own", "4: told", "7: own"]
    assert sorted(faults(path)) == there


def test_no_module_imports_a_test():
    """What several test modules use stands in modules that are no tests, so that a test may be moved or run alone."""
    texts = {path.name: path.read_text(encoding="utf-8") for path in Path(__file__).parent.rglob("*.py")}
    assert len(texts) > 100
    assert [name for name, text in texts.items() if re.search(r"^ *(from|import) .*\btest_", text, re.MULTILINE)] == []
