"""The self-test runs on SPARC V8 (LEON3), emulated in user mode; other processors have `link/test_qemu.py`. It is skipped,
with the reason, where the compiler or the emulator is not installed."""

import subprocess

import pytest

from starhold.export.folder import make_files
from tests.export.flown import build_in, code_of, need
from tests.tiers import leading

_HEADERS = {
    "math.h": 'double sqrt(double);\n#define INFINITY (__builtin_inf())\n#define NAN (__builtin_nan(""))\n',
    "stdio.h": "int printf(const char *, ...);\n",
    "stdint.h": "#include <stdint-gcc.h>\n",
    "string.h": "#include <stddef.h>\nvoid *memcpy(void *, const void *, size_t);\n",
}
_BARE = r"""
/* What the self-test needs where there is no library: copies, a printf that says nothing, and an end by main's value. */
#include <stddef.h>
void *memcpy(void *to, const void *from, size_t count)
{
    unsigned char *a = to;
    const unsigned char *b = from;
    while (count--) {
        *a++ = *b++;
    }
    return to;
}
void *memset(void *to, int value, size_t count)
{
    unsigned char *a = to;
    while (count--) {
        *a++ = (unsigned char)value;
    }
    return to;
}
int printf(const char *text, ...)
{
    (void)text;
    return 0;
}
__asm__(".globl _start\n_start:\n mov 0, %fp\n sub %sp, 96, %sp\n call main\n nop\n mov 1, %g1\n ta 0x10\n nop\n");
"""


@pytest.mark.parametrize("name", leading(["wheel", "estimator"]))
def test_leon3(name, tmp_path):
    """SPARC V8 without a library: main's value alone tells; a vector with one bit changed must fail."""
    compiler = "sparc64-linux-gnu-gcc"
    need(compiler, "qemu-sparc")
    own = subprocess.run([compiler, "-print-file-name=include"], capture_output=True, text=True).stdout.strip()
    for file, text in _HEADERS.items():
        (tmp_path / "include").mkdir(exist_ok=True)
        (tmp_path / "include" / file).write_text(text)
    files = make_files(code_of(name), "test", name).files
    for file, text in files.items():
        (tmp_path / file).write_text(text)
    sources = [file for file in files if file.endswith(".c")]
    (tmp_path / "bare.c").write_text(_BARE)
    flags = "-m32 -mcpu=leon3 -O2 -std=c99 -ffp-contract=off -fno-math-errno -nostdlib -nostdinc -static -isystem include"
    flags = [*flags.split(), "-isystem", own]
    build_in(tmp_path, compiler, *flags, *sources, "bare.c", "-o", "test")
    assert subprocess.run(["qemu-sparc", str(tmp_path / "test")]).returncode == 0
    selftest = next(tmp_path / source for source in sources if "selftest" in source)
    text = selftest.read_text()
    # The last number of the first step is a digest of what comes out; what goes in may not matter.
    place = text.rindex("UINT64_C(0x", 0, text.index("},\n")) + len("UINT64_C(0x")
    selftest.write_text(text[:place] + ("1" if text[place] != "1" else "2") + text[place + 1 :])
    build_in(tmp_path, compiler, *flags, *sources, "bare.c", "-o", "test")
    assert subprocess.run(["qemu-sparc", str(tmp_path / "test")]).returncode == 1
