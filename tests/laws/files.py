"""The laws that the page for their authors shows, as the text of one file each."""

import re
from pathlib import Path

PAGE = (Path(__file__).parents[2] / "docs" / "law-authors.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r"`(\w+\.py)`:\n\n```python\n(.*?)```", PAGE, flags=re.DOTALL))
