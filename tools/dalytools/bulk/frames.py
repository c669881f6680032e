# SPDX-License-Identifier: GPL-2.0-or-later
"""Which packets are one clean A5 frame: whole, its sum right, and no other window can begin in it.

    word 0                              word 1
    A5  addr id  08  d0  d1  d2  d3  |  d4  d5  d6  d7  sum  -   -   -

Of such frames in a row the splitter makes a record each, whatever comes next (docs/records.md, 2 and 3). A frame in
which another window could begin is looked at by the splitter itself, once for each that is different.
"""

from __future__ import annotations

from enum import Enum, auto
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from dalyref import a5
from dalyref.kinds import Kind
from dalyref.records import Splitter

if TYPE_CHECKING:
    from dalytools.bulk.arrays import Bytes, Flags, Ints, Words

_U = np.uint64
_START: Final = _U(0x0000_0000_FF00_00FF)
_A5_08: Final = _U(0x0000_0000_0800_00A5)
_EVEN: Final = _U(0x00FF_00FF_00FF_00FF)
_ADD: Final = _U(0x0001_0001_0001_0001)
_FOUR: Final = _U(0xFFFF_FFFF)
_BYTE: Final = _U(0xFF)
FIVE: Final = _U(0xFF_FFFF_FFFF)
"""The bytes of word 1 that are the frame's."""

_NEXT: Final = a5.build(0x01, 0x90)
"""Any clean frame."""
_REPLY, _REQUEST, _A5, _EIGHT = 1, 2, 4, 8


def _classes() -> bytes:
    """Sort bytes. Low half: address of Modbus (in replies, in requests), A5, 08; high half: a function for each."""
    table = bytearray(256)
    for byte in (0xD2, *range(0x51, 0x61)):
        table[byte] |= _REPLY
    for byte in range(0x81, 0x91):
        table[byte] |= _REQUEST
    table[0xA5] |= _A5
    table[0x08] |= _EIGHT
    for byte in (0x03, 0x06, 0x10, 0x83, 0x86, 0x90):
        table[byte] |= _REPLY << 4
    for byte in (0x03, 0x06, 0x10):
        table[byte] |= _REQUEST << 4
    return bytes(table)


def _masks(first: int, behind: int, bits: int) -> tuple[np.uint64, np.uint64]:
    """Return both words of a row with `bits` in some of its bytes."""
    row = bytes(bits if first <= at < behind else 0 for at in range(16))
    return _U(int.from_bytes(row[:8], "little")), _U(int.from_bytes(row[8:], "little"))


_CLASSES: Final = _classes()
# Of the sixteen bytes of a row, counted from its first: where a pair can begin (1 to 11), where an A5 with an 08 three
# behind it (1 to 9), and where an A5 that is cut off by the frame's end (10 to 12).
_PAIRS: Final = _masks(1, 12, _REPLY | _REQUEST)
_STARTS: Final = _masks(1, 10, _A5)
_LATE: Final = _masks(10, 13, _A5)


def gather(buffer: Bytes, offset: Ints) -> Words:
    """Return the sixteen bytes at each offset."""
    at_every_word = np.ndarray(((len(buffer) - 16) // 4 + 1,), "V16", buffer.data, 0, (4,))
    return at_every_word[offset >> 2].view(_U).reshape(len(offset), 2)


def good(words: Words) -> Flags:
    """Tell which rows begin with an A5 frame whose sum is right."""
    first, second = words[:, 0], words[:, 1]
    head = second & _FOUR
    eight = _U(8)
    total = (first & _EVEN) + (first >> eight & _EVEN) + (head & _EVEN) + (head >> eight & _EVEN)
    total = total * _ADD >> _U(48)
    return (first & _START == _A5_08) & ((total ^ second >> _U(32)) & _BYTE == 0)


def ambiguous(words: Words) -> Flags:
    """Tell in which rows, each a frame, another window begins or could begin (dalyref.heads.WHOLE)."""
    raw = np.frombuffer(words.tobytes().translate(_CLASSES) + bytes(8), np.uint8)
    size = words.size * 8
    here = raw[:size]
    out = np.zeros(len(words), _U)
    for found, masks in (
        (here & (raw[1 : size + 1] >> 4), _PAIRS),
        (here & (raw[3 : size + 3] >> 1), _STARTS),
        (here, _LATE),
    ):
        wide = found.view(_U).reshape(len(words), 2)
        out |= wide[:, 0] & masks[0]
        out |= wide[:, 1] & masks[1]
    return out != 0


class Stands(Enum):
    """What the splitter makes of a frame in which another window begins."""

    NO = auto()
    ALONE = auto()
    """A record by itself, whatever comes next."""
    BEFORE_FRAME = auto()
    """A record by itself if a frame, or silence, comes next (docs/records.md, 3)."""


@lru_cache(65536)
def stands(data: bytes) -> Stands:
    """Have the splitter look at a frame."""
    splitter = Splitter()
    records = splitter.feed(data)
    if len(records) == 1 and records[0].kind is Kind.FRAME and not splitter.pending:
        return Stands.ALONE
    records += splitter.feed(_NEXT)
    return Stands.BEFORE_FRAME if [record.data for record in records] == [data, _NEXT] else Stands.NO
