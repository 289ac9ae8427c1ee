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


def docstrings(path):
    """Line and text of the docstrings of a file's module, classes and functions."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
            text = ast.get_docstring(node)
            if text is not None:
                yield node.body[0].lineno, text


@pytest.mark.parametrize("folder", sorted({path.relative_to(SOURCE).parts[0] for path in SOURCE.rglob("*.py")}))
def test_docstrings_begin_with_a_sentence(folder):
    fragments = [
        f"{path.relative_to(SOURCE)}:{line}: {text.splitlines()[0]}"
        for path in files_of(SOURCE / folder)
        for line, text in docstrings(path)
        if FRAGMENT.match(text)
    ]
    assert fragments == []


def names(path):
    """Line and name of all that a file names: variables, arguments, attributes, keywords, functions and classes."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        for field in ("id", "arg", "attr", "name"):
            name = getattr(node, field, None)
            if isinstance(name, str):
                yield getattr(node, "lineno", 0), name


@pytest.mark.parametrize("folder", sorted({path.relative_to(SOURCE).parts[0] for path in SOURCE.rglob("*.py")}))
def test_names_say_what_a_value_is(folder):
    bare = [
        f"{path.relative_to(SOURCE)}:{line}: {name}"
        for path in files_of(SOURCE / folder)
        for line, name in names(path)
        if name in BARE
    ]
    assert bare == []


def test_no_module_imports_a_test():
    """What several test modules use stands in modules that are no tests, so that a test may be moved or run alone."""
    texts = {path.name: path.read_text(encoding="utf-8") for path in Path(__file__).parent.rglob("*.py")}
    assert len(texts) > 100
    assert [name for name, text in texts.items() if re.search(r"^ *(from|import) .*\btest_", text, re.MULTILINE)] == []
