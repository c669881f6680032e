# SPDX-License-Identifier: GPL-2.0-or-later
"""Modbus frames of Daly with what is secret blanked, by register (docs/protocol.md, d); the CRC is made right again.

    read reply    which registers it brings is known from the request; where it is not, nothing in it is
    write         says its registers itself

A register that reads FFFF is not there, and one of 0 says nothing: both stay.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Final

from dalyref import modbus, modbus_frame, registers_81, registers_d2
from dalyref.modbus_frame import Shape
from dalytools.redact.what import What, named

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dalytools.redact.blanker import Blanker

_POSITION: Final = range(0x57, 0x6A)
"""Of D2: GPS and IMEI, in an order that two tables of the vendor tell differently."""
_SHOWN_TO_NOBODY: Final = {
    True: (0x3E,),  # D2: mileage, or a mask
    False: (0x3B, *range(0x4F, 0x52), 0x64, *range(0x66, 0x6A), *range(0x6D, 0x74)),  # SOH, mask, minutes, faults
}
"""Registers whose content is told, differently, by several: all of it harmless."""
_TEXT_WORDS: Final = 4
_LETTERS: Final = range(0x20, 0x7F)
_CURRENTS: Final = range(27000, 33000)
"""A current of up to 300 A looks like two letters."""


@cache
def _registers(*, d2: bool) -> Mapping[int, What | None]:
    """Return what each register that a map names is; None: harmless."""
    table = registers_d2.MAP if d2 else registers_81.MAP
    known: dict[int, What | None] = {}
    for first, last, name, _ in (*table.told, *table.settings):
        for register in range(first, last + 1):
            known[register] = known.get(register) or named(name)
    for register in (*table.cells, *table.sensors, *table.faults, *(table.commands or ()), *_SHOWN_TO_NOBODY[d2]):
        known.setdefault(register, None)
    if d2:
        known.update(dict.fromkeys(_POSITION, What.POSITION))
    return known


def blank(raw: bytes, register: int | None, blanker: Blanker) -> bytes:
    """Blank a good window. register: the first that a read reply brings, None where that is not known."""
    frame = modbus_frame.parse(raw)
    if not frame.data:
        return raw
    where = f"Modbus {'D2' if frame.d2 else '81'}"
    start = register if frame.shape is Shape.READ_REPLY else frame.register
    spans = _spans(frame.data, start, d2=frame.d2)
    at = len(raw) - 2 - len(frame.data)
    if start is None:
        where += " replies to an unknown request"
    data = blanker.spans(frame.data, spans, where, written=frame.shape is not Shape.READ_REPLY)
    return with_crc(raw[:at] + data) if data != frame.data else raw


def with_crc(body: bytes) -> bytes:
    """Put the CRC behind a frame that has none."""
    return body + modbus.crc(body).to_bytes(2, "little")


def _spans(data: bytes, start: int | None, *, d2: bool) -> list[tuple[int, int, What]]:
    """Return the spans that are to be blanked: neighbours of one kind together."""
    known = _registers(d2=d2)
    spans: list[tuple[int, int, What]] = []
    letters = _lettered(data)
    for at in range(0, len(data), 2):
        register = None if start is None else start + at // 2
        what = What.UNKNOWN if register is None else known.get(register, What.UNKNOWN)
        if what is None and at in letters and not _is_text(register, d2=d2):
            what = What.UNKNOWN  # these registers hold numbers, and here is a text: the reply is another's
        if what is None or (what is What.UNKNOWN and data[at : at + 2] in (b"\x00\x00", b"\xff\xff")):
            continue
        if spans and spans[-1][1:] == (at - 1, what):
            spans[-1] = (spans[-1][0], at + 1, what)
        else:
            spans.append((at, at + 1, what))
    return spans


def _lettered(data: bytes) -> set[int]:
    """Return the offsets of registers that are part of four or more in a row which look like text."""
    found: set[int] = set()
    run: list[int] = []
    for at in (*range(0, len(data), 2), len(data)):
        word = data[at : at + 2]
        if len(word) == 2 and word[0] in _LETTERS and word[1] in _LETTERS and int.from_bytes(word) not in _CURRENTS:
            run.append(at)
            continue
        if len(run) >= _TEXT_WORDS:
            found.update(run)
        run = []
    return found


@cache
def _versions(*, d2: bool) -> frozenset[int]:
    table = registers_d2.MAP if d2 else registers_81.MAP
    return frozenset(
        register for first, last, name, _ in table.told if "version" in name for register in range(first, last + 1)
    )


def _is_text(register: int | None, *, d2: bool) -> bool:
    return register in _versions(d2=d2)
