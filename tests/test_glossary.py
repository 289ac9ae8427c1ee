"""The glossary has every term once, in both languages, and its terms are those that are used."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]


def glossary():
    """Term, Russian term and meaning of every row."""
    lines = [
        line for line in (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").splitlines() if line.startswith("| ")
    ]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [row for row in rows if row[0] not in ("term", "---")]


def test_glossary_has_each_term_once_in_both_languages():
    terms = [term for term, _, _ in glossary()]
    assert len(terms) == len(set(terms)) > 50
    for term, russian, meaning in glossary():
        assert re.search("[а-я]{3}", russian), term
        assert meaning[0].isupper() or meaning[0] == "`", term
        assert meaning.endswith("."), term


def test_words_of_the_glossary_are_used_and_its_keys_are_keys():
    """In another page or in the source, be it as part of a name; what stands in code type is a key of scenario files, of
    gains or of certificates. Every role of a loop, which has a folder of parts, has a word."""
    pages = [path for path in (ROOT / "docs").glob("*.md") if path.name != "glossary.md"]
    files = [ROOT / "README.md", *pages, *(ROOT / "src").rglob("*.py")]
    written = "\n".join(f"{path.relative_to(ROOT)}\n{path.read_text(encoding='utf-8')}" for path in files)
    for term, _, meaning in glossary():
        assert re.search(re.escape(term).replace(r"\ ", r"[\s_-]+"), written, re.IGNORECASE), term
        for key in re.findall("`(.*?)`", meaning):
            assert re.search(rf"\b{key}\b *[:=]|\"{key}\"", written), (term, key)
    roles = {path.parent.name for path in (ROOT / "src" / "starhold" / "parts").glob("*/__init__.py")}
    assert len(roles) >= 7
    assert {{"bodies": "body"}.get(name, name.rstrip("s")) for name in roles} <= {row[0] for row in glossary()}
