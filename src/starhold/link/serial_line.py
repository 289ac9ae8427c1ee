"""A plant at the end of a serial line."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable

from starhold.errors import optional
from starhold.link.server import Line, Stream, refused


async def serial_line(line: Line, device: str, baud: int) -> tuple[str, Callable[[], None]]:
    """Open a serial device, 8N1 without flow control, whose bytes are one stream of messages. After a reset a board sends
    its hello message again. Raise InputError if it cannot be opened, or without the extra `serial`."""
    serial = optional("serial", "serve --serial", "serial")
    with refused("--serial, --baud", f"{device} at {baud} baud", "a serial device that nobody else uses, and its baud rate"):
        try:
            port = serial.Serial(device, baud, exclusive=True)
        except (OSError, ValueError) as error:
            code: int | None = getattr(error, "errno", None)
            raise OSError(str(error) if code is None else os.strerror(code)) from None
    loop = asyncio.get_running_loop()
    # A transport buffers the bytes to send, so that a slow line delays no period.
    writer, _ = await loop.connect_write_pipe(asyncio.BaseProtocol, os.fdopen(os.dup(port.fileno()), "wb", buffering=0))
    await loop.connect_read_pipe(lambda: Stream(line, writer), port)
    return f"{device} at {baud} baud", writer.close
