"""Programs run on the first NVIDIA GPU of this machine by its driver: each thread is a lane, each number has a row of lanes.

The driver makes code of the printed text. Its operations round to nearest, and none may be fused with another.
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
"""Threads of a block."""
OLDEST = 80
"""The first architecture for which the text is printed: 80 for sm_80, an A100."""
_WHOLE = 0xFFFFFFFFFFFFFFFF


class Rows:
    """Rows (numbers, lanes) in the memory of a GPU; that is given back when nobody refers to them."""

    def __init__(self, device: Device, numbers: int, lanes: int) -> None:
        self.shape, self._device = (numbers, lanes), device
        self.address = int(device.call("cuMemAlloc", max(8, self.size)))
        # At its end the process gives back all.
        weakref.finalize(self, device.call, "cuMemFree", self.address).atexit = False

    @property
    def size(self) -> int:
        """The number of bytes."""
        return 8 * self.shape[0] * self.shape[1]

    def row(self, number: int) -> int:
        """Return the address of a row."""
        return self.address + 8 * self.shape[1] * number

    def fill(self, rows: Array, first: int = 0) -> None:
        """Put rows (numbers, lanes) there, from the row `first` on."""
        given = np.ascontiguousarray(rows, dtype=np.float64)
        if given.size:
            self._device.call("cuMemcpyHtoD", self.row(first), given.ctypes.data, given.nbytes)

    def read(self) -> Array:
        """Return the numbers, once all that was begun before is done."""
        numbers = np.empty(self.shape)
        if numbers.size:
            self._device.call("cuMemcpyDtoH", numbers.ctypes.data, self.address, numbers.nbytes)
        return numbers


class Device:
    """The first GPU. InputError, in one line, where there is none that can fly."""

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
        """Return what a function of the driver gives, None for nothing. DeviceError where it fails."""
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
        """Return rows with these values (numbers, lanes)."""
        made = Rows(self, *values.shape)
        made.fill(values)
        return made

    def begin(self, program: Program, memories: Mapping[str, Rows], counts: Sequence[int], lanes: int) -> None:
        """Begin to run a program on rows, after all that was begun before."""
        addresses = [memories[memory.name].address for memory in program.memories]
        given = np.array([*addresses, *(count & _WHOLE for count in counts), lanes], dtype=np.uint64)
        places = given.ctypes.data + 8 * np.arange(len(given), dtype=np.uint64)
        blocks = -(-lanes // THREADS)
        # What the places point to is copied before this returns.
        self.call("cuLaunchKernel", self.load(program), blocks, 1, 1, THREADS, 1, 1, 0, 0, places.ctypes.data, 0)


class DeviceError(RuntimeError):
    """A function of the driver failed."""
