"""Texts of files in few lines."""

import re


def toml(text):
    """Tables of which each stands on a line: its entries follow its name, with semicolons between them."""
    return re.sub(r"^(\[+[\w.]+\]+) (?=\S)", r"\1\n", text, flags=re.MULTILINE).replace("; ", "\n")
