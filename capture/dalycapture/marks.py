# SPDX-License-Identifier: GPL-2.0-or-later
"""Line errors as the kernel marks them among the bytes (PARMRK; termios(3)).

    FF FF       a good byte FF
    FF 00 00    a break; so comes a byte 00 without a stop bit, which looks the same on the wire
    FF 00 xx    xx was received with a framing error (or, where the format has parity, a parity error)

A mark may be torn between two reads.
"""

from __future__ import annotations

from typing import NamedTuple

_ESCAPE = 0xFF


class Unmarked(NamedTuple):
    """Bytes without their marks. errors, breaks: offsets in ``data`` of bad bytes, and where breaks came before."""

    data: bytes
    errors: list[int]
    breaks: list[int]


class Unmarker:
    """Takes the marks out of one stream."""

    def __init__(self) -> None:
        self._held = b""  # the beginning of a mark

    def feed(self, data: bytes) -> Unmarked:
        """Take the bytes of one read."""
        if not self._held and _ESCAPE not in data:
            return Unmarked(data, [], [])
        data = self._held + data
        out, errors, breaks = bytearray(), list[int](), list[int]()
        at, end = 0, len(data)
        while (mark := data.find(_ESCAPE, at)) >= 0:
            out += data[at:mark]
            at = mark
            if end - mark < 2 or (data[mark + 1] == 0 and end - mark < 3):
                break
            if data[mark + 1] == _ESCAPE:
                out.append(_ESCAPE)
                at = mark + 2
            elif data[mark + 1]:  # the kernel writes no such thing; no byte is lost for it
                out.append(_ESCAPE)
                at = mark + 1
            else:
                if data[mark + 2]:
                    errors.append(len(out))
                    out.append(data[mark + 2])
                else:
                    breaks.append(len(out))
                at = mark + 3
        else:
            out += data[at:]
            at = end
        self._held = data[at:]
        return Unmarked(bytes(out), errors, breaks)

    def flush(self) -> bytes:
        """Give out what is held, as it is: no more bytes come."""
        held, self._held = self._held, b""
        return held
