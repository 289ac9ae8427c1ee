"""A GPU for tests: PTX is read and run in plain Python, one thread after the other, behind the driver's functions.

Registers hold floats or whole numbers, and are read as the instruction needs them. What an instruction does is taken from
NVIDIA's PTX ISA, not from what printed it."""

# ruff: noqa: N802, the driver names its functions

import ctypes
import math
import re
import struct
from types import SimpleNamespace
from typing import Any

import numpy as np

WHOLE = 2**64 - 1


def as_float(x: Any) -> float:
    return x if isinstance(x, float) else struct.unpack("<d", struct.pack("<Q", x & WHOLE))[0]


def as_bits(x: Any) -> int:
    return struct.unpack("<Q", struct.pack("<d", x))[0] if isinstance(x, float) else x & WHOLE


def as_signed(x: Any) -> int:
    bits = as_bits(x)
    return bits - 2**64 if bits >> 63 else bits


def divided(a: float, b: float) -> float:
    with np.errstate(all="ignore"):
        return float(np.float64(a) / np.float64(b))


def root(a: float) -> float:
    return math.sqrt(a) if a >= 0.0 else math.nan


def larger(a: float, b: float) -> float:
    """Not a number only where both are; +0 is larger than -0."""
    if a != a or b != b:
        return b if a != a else a
    return max(a, b, key=lambda x: (x, math.copysign(1.0, x)))


def smaller(a: float, b: float) -> float:
    return -larger(-a, -b)


def rotated(low: int, high: int, count: int) -> int:
    """The upper 32 bits of both words, shifted left by the count."""
    return (((high << 32 | low) << (count & 31)) >> 32) & 0xFFFFFFFF


COMPARED = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}
READ = {"f64": "as_float", "s64": "as_signed", "u64": "as_bits", "b64": "as_bits"}
SIGNS = {"add": "+", "sub": "-", "mul": "*", "and": "&", "or": "|", "xor": "^"}
PLAIN = {
    r"(add|sub|mul)\.rn\.f64": lambda m, d, a, b: (
        f"{d} = as_float({a}) {'+-*'[('add', 'sub', 'mul').index(m[1])]} as_float({b})"
    ),
    r"div\.rn\.f64": lambda m, d, a, b: f"{d} = divided(as_float({a}), as_float({b}))",
    r"rcp\.rn\.f64": lambda m, d, a: f"{d} = divided(1.0, as_float({a}))",
    r"sqrt\.rn\.f64": lambda m, d, a: f"{d} = root(as_float({a}))",
    r"neg\.f64": lambda m, d, a: f"{d} = -as_float({a})",
    r"abs\.f64": lambda m, d, a: f"{d} = abs(as_float({a}))",
    r"max\.f64": lambda m, d, a, b: f"{d} = larger(as_float({a}), as_float({b}))",
    r"min\.f64": lambda m, d, a, b: f"{d} = smaller(as_float({a}), as_float({b}))",
    r"add\.[su]64": lambda m, d, a, b: f"{d} = (as_bits({a}) + as_bits({b})) & WHOLE",
    r"sub\.[su]64": lambda m, d, a, b: f"{d} = (as_bits({a}) - as_bits({b})) & WHOLE",
    r"mul\.lo\.[su]64": lambda m, d, a, b: f"{d} = (as_bits({a}) * as_bits({b})) & WHOLE",
    r"mad\.lo\.[su]64": lambda m, d, a, b, c: f"{d} = (as_bits({a}) * as_bits({b}) + as_bits({c})) & WHOLE",
    r"mul\.wide\.u32": lambda m, d, a, b: f"{d} = {a} * {b}",
    r"shl\.b64": lambda m, d, a, b: f"{d} = (as_bits({a}) << {b}) & WHOLE",
    r"shr\.u64": lambda m, d, a, b: f"{d} = as_bits({a}) >> {b}",
    r"(and|or|xor)\.b64": lambda m, d, a, b: f"{d} = as_bits({a}) {SIGNS[m[1]]} as_bits({b})",
    r"(and|or|xor)\.pred": lambda m, d, a, b: f"{d} = {a} {SIGNS[m[1]]} {b}",
    r"not\.pred": lambda m, d, a: f"{d} = not {a}",
    r"shf\.l\.wrap\.b32": lambda m, d, a, b, c: f"{d} = rotated({a}, {b}, {c})",
    r"cvt\.u64\.u32": lambda m, d, a: f"{d} = {a}",
    r"cvt\.rn\.f64\.s64": lambda m, d, a: f"{d} = float(as_signed({a}))",
    r"cvta\.to\.global\.u64": lambda m, d, a: f"{d} = {a}",
    r"mov\.b64 (?=\{)": lambda m, low, high, a: f"{low}, {high} = as_bits({a}) & 0xFFFFFFFF, as_bits({a}) >> 32",
    r"mov\.b64 (?=%\w+, \{)": lambda m, d, low, high: f"{d} = {low} | {high} << 32",
    r"mov\.(?:b64|u64|u32|b32|f64|pred)": lambda m, d, a: f"{d} = {a}",
    r"selp\.(?:f64|b64|u64)": lambda m, d, a, b, p: f"{d} = {a} if {p} else {b}",
    r"setp\.([a-z]{2})(u?)\.(\w+)": lambda m, p, a, b: compared(m, p, a, b),
    r"ld\.param\.b64": lambda m, d, a: f"{d} = given[{a}]",
    r"ld\.global(?:\.nc)?\.(?:b64|f64)": lambda m, d, a: f"{d} = memory.get({a})",
    r"st\.global\.(?:b64|f64)": lambda m, a, x: f"memory.put({a}, as_float({x}))",
}
"""What an instruction of such a name does, as Python; others are refused."""


def compared(m: Any, p: str, a: str, b: str) -> str:
    read = READ[m[3]]
    said = f"{read}({a}) {COMPARED[m[1]]} {read}({b})"
    if (m[1], m[2], m[3]) == ("ne", "", "f64"):
        said += f" and {read}({a}) == {read}({a}) and {read}({b}) == {read}({b})"
    # Unordered comparisons are true of what is not a number, as Python's != alone is.
    return f"{p} = {said}" + (f" or {read}({a}) != {read}({a}) or {read}({b}) != {read}({b})" if m[2] else "")


def operand(text: str) -> str:
    """A register, a number or an address as Python."""
    text = text.strip()
    if text.startswith("["):
        inner = text[1:-1]
        if not inner.startswith("%"):
            return inner.rpartition("_")[2]
        base, _, offset = inner.partition("+")
        return f"as_bits({operand(base)}) + {offset or 0}"
    if text.startswith("0d"):
        return repr(int(text[2:], 16))
    return text.replace("%", "r_").replace(".", "_") if text.startswith("%") else text


class Kernel:
    """A kernel made of its text. Blocks of instructions are pieces of one function with a place to go on at."""

    def __init__(self, text: str) -> None:
        found = re.search(r"\.visible \.entry (\w+)\((.*?)\)\s*\{(.*?)\n\}", text, re.S)
        assert found is not None
        self.name, (parameters, body) = found[1], found.groups()[1:]
        self.count = parameters.count(".param")
        pieces, labels = [list[str]()], dict[str, int]()
        for line in body.splitlines():
            line = re.sub(r"//.*", "", line).strip().rstrip(";")
            if label := re.fullmatch(r"(\$\w+):", line):
                pieces.append([])
                labels[label[1]] = len(pieces) - 1
            elif line and not line.startswith("."):
                pieces[-1].append(line)
        code = ["def run(r_tid_x, r_ctaid_x, r_ntid_x, given, memory):", " at = 0", " while True:"]
        for place, lines in enumerate(pieces):
            code.append(f"  if at == {place}:")
            for line in lines:
                code += [f"   {one}" for one in self._code(line, labels)]
            code.append(f"   at = {place + 1}")
        code.append(f"  if at >= {len(pieces)}: raise AssertionError('ran past the end')")
        names: dict[str, Any] = dict(globals())
        exec("\n".join(code), names)
        self.run = names["run"]

    def _code(self, line: str, labels: dict[str, int]) -> list[str]:
        guard = re.match(r"@(!?)(%\w+)\s+(.*)", line)
        if guard:
            (jump,) = self._code(guard[3], labels)[:-1]
            return [f"if {'not ' * bool(guard[1])}{operand(guard[2])}:", f" {jump}", " continue"]
        name, _, rest = line.partition(" ")
        if name.startswith("bra"):
            return [f"at = {labels[rest.strip()]}", "continue"]
        if name == "ret":
            return ["return"]
        for pattern, make in PLAIN.items():
            # Of pairs in braces the place matters.
            found = re.match(pattern, f"{name} {rest.strip()}") if " " in pattern else re.fullmatch(pattern, name)
            if found:
                return [make(found, *map(operand, re.sub(r"[{}]", "", rest).split(",")))]
        raise AssertionError(f"an instruction that nobody taught: {line}")


class Memory:
    """Numbers by address, each within what was allocated."""

    def __init__(self) -> None:
        self.parts = dict[int, np.ndarray[Any, Any]]()
        self.next, self.freed = 4096, 0

    def allocate(self, size: int) -> int:
        address, self.next = self.next, self.next + size + 4096 - size % 4096
        self.parts[address] = np.full(-(-size // 8), np.nan)
        return address

    def at(self, address: int, count: int = 1) -> Any:
        begin = max(start for start in self.parts if start <= address)
        place, off = divmod(address - begin, 8)
        assert off == 0
        assert place + count <= len(self.parts[begin]), "beyond what was allocated"
        return self.parts[begin], place

    def get(self, address: int) -> float:
        part, place = self.at(address)
        return float(part[place])

    def put(self, address: int, x: float) -> None:
        part, place = self.at(address)
        part[place] = x


class Driver:
    """The functions of the driver that are called, as `cuda.bindings.driver` has them: an error code, then results."""

    CUdevice_attribute = SimpleNamespace(
        CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR=75, CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MINOR=76
    )

    def __init__(self, capability: tuple[int, int] = (9, 0)) -> None:
        self.memory, self.capability, self.launched = Memory(), capability, list[int]()
        self.loaded = 0

    def cuInit(self, flags: int) -> tuple[int]:
        return (0,)

    def cuDeviceGet(self, number: int) -> tuple[int, int]:
        return 0, number

    def cuDeviceGetAttribute(self, which: int, device: int) -> tuple[int, int]:
        return 0, self.capability[which - 75]

    def cuDevicePrimaryCtxRetain(self, device: int) -> tuple[int, str]:
        return 0, "context"

    def cuCtxSetCurrent(self, context: str) -> tuple[int]:
        assert context == "context"
        return (0,)

    def cuModuleLoadData(self, address: int) -> tuple[int, Kernel]:
        self.loaded += 1
        return 0, Kernel(ctypes.string_at(address).decode())

    def cuModuleGetFunction(self, module: Kernel, name: bytes) -> tuple[int, Kernel]:
        assert module.name == name.decode()
        return 0, module

    def cuMemAlloc(self, size: int) -> tuple[int, int]:
        return 0, self.memory.allocate(size)

    def cuMemFree(self, address: int) -> tuple[int]:
        del self.memory.parts[address]
        self.memory.freed += 1
        return (0,)

    def cuMemcpyHtoD(self, to: int, start: int, size: int) -> tuple[int]:
        part, place = self.memory.at(to, size // 8)
        part[place : place + size // 8] = np.frombuffer(ctypes.string_at(start, size))
        return (0,)

    def cuMemcpyDtoH(self, to: int, start: int, size: int) -> tuple[int]:
        part, place = self.memory.at(start, size // 8)
        ctypes.memmove(to, part[place : place + size // 8].ctypes.data, size)
        return (0,)

    def cuMemcpyDtoD(self, to: int, start: int, size: int) -> tuple[int]:
        part, place = self.memory.at(start, size // 8)
        other, there = self.memory.at(to, size // 8)
        other[there : there + size // 8] = part[place : place + size // 8]
        return (0,)

    def cuMemsetD32(self, to: int, word: int, count: int) -> tuple[int]:
        part, place = self.memory.at(to, count // 2)
        assert word == 0
        part[place : place + count // 2] = 0.0
        return (0,)

    def cuLaunchKernel(self, kernel: Kernel, *given: int) -> tuple[int]:
        (blocks, _, _, threads, _, _, shared, stream, places, extra) = given
        assert (given[1:3], given[4:6], shared, stream, extra) == ((1, 1), (1, 1), 0, 0, 0)
        pointers = (ctypes.c_uint64 * kernel.count).from_address(places)
        values = [ctypes.c_uint64.from_address(place).value for place in pointers]
        self.launched.append(blocks * threads)
        for block in range(blocks):
            for thread in range(threads):
                kernel.run(thread, block, threads, values, self.memory)
        return (0,)
