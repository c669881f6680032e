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
    from dalytools.bulk.arrays import Bytes, Flags, Ints, Words, Words64

_U = np.uint64
_U8 = np.uint8
_START: Final = np.uint32(0xFF00_00FF)
_A5_08: Final = np.uint32(0x0800_00A5)
_FIXED: Final = _U8(0xA5 + 0x08)
"""What these two add to the sum."""
_EVEN: Final = _U(0x00FF_00FF_00FF_00FF)
_ADD: Final = _U(0x0001_0001_0001_0001)
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
_AT_ONCE: Final = 8192
"""So many rows are looked at before the next: they stay in the processor's cache."""
_PAIRS_IN_DATA: Final = _U(0x0003_0303_0303_0303)
"""Where a pair can begin in eight bytes."""
_A5_IN_DATA: Final = _U(0x0101_0101_0101_0101 * _A5)


def whole(words: Words) -> tuple[Flags, Ints]:
    """Tell which rows begin with an A5 frame whose sum is right, and in which of these another window may begin."""
    good = np.zeros(len(words), np.bool_)
    some = [_whole(words[begin : begin + _AT_ONCE], begin, good) for begin in range(0, len(words), _AT_ONCE)]
    return good, np.concatenate(some) if some else np.zeros(0, np.int64)


def _whole(words: Words, begin: int, out: Flags) -> Ints:
    """Look at some rows, of which `begin` is the first: set the flags of those with a frame; return the doubtful."""
    raw = words.view(np.uint8).reshape(-1, 16)
    address, data_id, sent = raw[:, 1].copy(), raw[:, 2].copy(), raw[:, 12].copy()
    data = np.ndarray((len(words),), _U, words, 4, (16,)).copy()
    some = _maybe_ambiguous(address, data_id, data, sent)
    # The sum of the eight data bytes: as four numbers of 16 bits, then as one.
    total = data & _EVEN
    data >>= _U(8)
    data &= _EVEN
    total += data
    total *= _ADD
    total >>= _U(48)
    low = total.astype(np.uint8)
    low += address
    low += data_id
    low += _FIXED
    good = low == sent
    good &= (words.view(np.uint32)[:, 0] & _START) == _A5_08
    out[begin : begin + len(words)] = good
    some = some[good[some]]
    return begin + some[_ambiguous(words[some])]


def _maybe_ambiguous(address: Bytes, data_id: Bytes, data: Words64, sent: Bytes) -> Ints:
    """Return some rows that `_ambiguous` is to look at; in the others nothing else can begin."""
    # Byte 3 is 08: it is no address and no function.
    here, behind, last = (
        np.frombuffer(each.tobytes().translate(_CLASSES), np.uint8) for each in (address, data_id, sent)
    )
    found = (here & behind >> _U8(4)) | ((here | behind | last) & _U8(_A5))
    each = np.frombuffer(data.tobytes().translate(_CLASSES), _U)
    found |= (each >> _U(56)).astype(np.uint8) & last >> _U8(4)
    pairs = each >> _U(12)
    pairs &= each
    pairs &= _PAIRS_IN_DATA
    pairs |= each & _A5_IN_DATA
    return np.flatnonzero((pairs != 0) | (found != 0))


def _ambiguous(words: Words) -> Flags:
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
