"""Programs run on the first NVIDIA GPU of this machine by its driver: each thread is a lane, each number has a row of lanes.

The driver compiles the printed text, whose operations round to nearest and may not be fused.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from starhold.errors import InputError, optional
from starhold.trace.program import Program
from starhold.trace.ptx import ptx

Array: TypeAlias = NDArray[np.float64]

THREADS = 128
"""Threads per block."""
OLDEST = 80
"""The first architecture for which the text is printed: 80 for sm_80, an A100."""
_WHOLE = 0xFFFFFFFFFFFFFFFF


class Rows:
    """Rows (numbers, lanes) in the memory of a GPU, which is freed when the object is deleted."""

    def __init__(self, device: Device, numbers: int, lanes: int) -> None:
        self.shape, self._device = (numbers, lanes), device
        self.address = int(device.call("cuMemAlloc", max(8, self.size)))
        # The process frees everything at its end.
        weakref.finalize(self, device.call, "cuMemFree", self.address).atexit = False

    @property
    def size(self) -> int:
        """The number of bytes."""
        return 8 * self.shape[0] * self.shape[1]

    def row(self, number: int) -> int:
        """Return the address of a row."""
        return self.address + 8 * self.shape[1] * number

    def fill(self, rows: Array, first: int = 0) -> None:
        """Copy rows (numbers, lanes) there, from the row `first` on."""
        given = np.ascontiguousarray(rows, dtype=np.float64)
        if given.size:
            self._device.call("cuMemcpyHtoD", self.row(first), given.ctypes.data, given.nbytes)

    def read(self) -> Array:
        """Return the numbers (numbers, lanes), after all earlier work has finished."""
        numbers = np.empty(self.shape)
        if numbers.size:
            self._device.call("cuMemcpyDtoH", numbers.ctypes.data, self.address, numbers.nbytes)
        return numbers


class Device:
    """The first GPU. Raises InputError if there is no usable one."""

    def __init__(self) -> None:
        self._driver = optional("cuda.bindings.driver", user="gpu", bundle="gpu")
        allowed = "an NVIDIA GPU from sm_80 on, with its driver"
        try:
            self.call("cuInit", 0)
            device = self.call("cuDeviceGet", 0)
            which = self._driver.CUdevice_attribute
            kinds = (f"CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_{part}" for part in ("MAJOR", "MINOR"))
            major, minor = (self.call("cuDeviceGetAttribute", getattr(which, kind), device) for kind in kinds)
            self.call("cuCtxSetCurrent", self.call("cuDevicePrimaryCtxRetain", device))
        except (RuntimeError, OSError) as error:
            # The bindings raise these where the driver's library is missing.
            raise InputError("campaign", "gpu", f"no driver that works ({error})", allowed) from None
        if 10 * major + minor < OLDEST:
            raise InputError("campaign", "gpu", f"sm_{major}{minor}", allowed)
        self.processor = f"sm_{major}{minor}"
        self._kernels: dict[int, tuple[Program, Any]] = {}

    def call(self, name: str, *given: Any) -> Any:
        """Return the result of a function of the driver, None if it has none. Raise DeviceError where it fails."""
        code, *results = getattr(self._driver, name)(*given)
        if int(code):
            raise DeviceError(f"{name}: {getattr(code, 'name', int(code))}")
        return results[0] if results else None

    def load(self, program: Program) -> Any:
        """Return a program as a kernel, compiled once."""
        if id(program) not in self._kernels:
            try:
                text = ctypes.create_string_buffer(ptx(program, self.processor).encode())
            except RuntimeError as error:
                raise DeviceError(f"LLVM cannot print for GPUs: {error}") from None
            module = self.call("cuModuleLoadData", ctypes.addressof(text))
            # The program is kept, so that no other gets its id.
            self._kernels[id(program)] = program, self.call("cuModuleGetFunction", module, program.main.name.encode())
        return self._kernels[id(program)][1]

    def rows(self, values: Array) -> Rows:
        """Return rows on the GPU with these values (numbers, lanes)."""
        made = Rows(self, *values.shape)
        made.fill(values)
        return made

    def begin(self, program: Program, memories: Mapping[str, Rows], counts: Sequence[int], lanes: int) -> None:
        """Start a program on rows; it runs after all earlier work."""
        addresses = [memories[memory.name].address for memory in program.memories]
        given = np.array([*addresses, *(count & _WHOLE for count in counts), lanes], dtype=np.uint64)
        places = given.ctypes.data + 8 * np.arange(len(given), dtype=np.uint64)
        blocks = -(-lanes // THREADS)
        # The arguments are copied before this returns.
        self.call("cuLaunchKernel", self.load(program), blocks, 1, 1, THREADS, 1, 1, 0, 0, places.ctypes.data, 0)


class DeviceError(RuntimeError):
    """A function of the driver failed."""
