"""The self-test runs on processors that fly: SPARC V8 (LEON3), SPARC V9, ARM and RISC-V, emulated in user mode. Skipped,
with the reason, where a compiler or the emulator is not installed."""

import subprocess
from pathlib import Path

import pytest

from starhold.export.folder import make_files
from tests.export.flown import build_in, code_of, need
from tests.tiers import leading

LINUX = {
    "ARMv7": ("arm-linux-gnueabihf-gcc", "qemu-arm"),
    "RISC-V 64": ("riscv64-linux-gnu-gcc", "qemu-riscv64"),
    "SPARC V9": ("sparc64-linux-gnu-gcc", "qemu-sparc64"),
}
NAMES = ["wheel", "estimator"]
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


def put(name: str, folder: Path) -> tuple[str, ...]:
    """Write the files of a law; the C among them."""
    files = make_files(code_of(name), "test", name).files
    for file, text in files.items():
        (folder / file).write_text(text)
    return tuple(file for file in files if file.endswith(".c"))


@pytest.mark.parametrize("name", leading(NAMES))
@pytest.mark.parametrize("target", leading(LINUX))
def test_linux(target, name, tmp_path):
    compiler, emulator = LINUX[target]
    need(compiler, emulator)
    sources = put(name, tmp_path)
    for level in ("-O0", "-O2"):
        build_in(tmp_path, compiler, "-std=c99", "-ffp-contract=off", level, "-static", *sources, "-o", "test", "-lm")
        done = subprocess.run([emulator, str(tmp_path / "test")], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout
        assert "of 192 steps give the bits" in done.stdout


@pytest.mark.parametrize("name", leading(NAMES))
def test_leon3(name, tmp_path):
    """SPARC V8 without a library: main's value alone tells; a vector with one bit changed must fail."""
    compiler = "sparc64-linux-gnu-gcc"
    need(compiler, "qemu-sparc")
    own = subprocess.run([compiler, "-print-file-name=include"], capture_output=True, text=True).stdout.strip()
    for file, text in _HEADERS.items():
        (tmp_path / "include").mkdir(exist_ok=True)
        (tmp_path / "include" / file).write_text(text)
    sources = put(name, tmp_path)
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
