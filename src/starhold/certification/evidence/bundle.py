"""Makes kernel.pyz, the kernel as one file that Python runs by itself, the same bytes wherever it is made."""

import io
import zipfile
from pathlib import Path

from starhold import kernel

_RUN = "import sys\nfrom kernel.check import main\nsys.exit(main(sys.argv[1:]))\n"


def kernel_bundle() -> bytes:
    """Return the bytes of kernel.pyz: python3 -I -S kernel.pyz certificate.json."""
    folder, content = Path(kernel.__file__).parent, io.BytesIO()
    files = {f"kernel/{path.relative_to(folder).as_posix()}": path.read_bytes() for path in folder.rglob("*.py")}
    with zipfile.ZipFile(content, "w", zipfile.ZIP_STORED) as archive:
        for name, data in sorted((files | {"__main__.py": _RUN.encode()}).items()):
            entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            entry.create_system, entry.external_attr = 3, 0o644 << 16
            archive.writestr(entry, data)
    return content.getvalue()
