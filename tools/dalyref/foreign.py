# SPDX-License-Identifier: GPL-2.0-or-later
"""Other people's traffic on the same pair: named, never decoded as Daly (docs/records.md, section 4).

    Modbus RTU    frames end to end, any address but Daly's, right CRC, a length that the function allows
    Sinowealth    request | 0A | register 01..16 | length 02, 04 |    reply | length bytes | crc-8 |
    Pylontech     | 7E | 8 digits | 4: how many to come | digits | 4: sum | 0D |    digits of hex in ASCII
    JBD           | DD | any | any | length | bytes | sum, 2 | 77 |

Sinowealth boards: field notes, section b. The CRC-8 (polynomial 07, start 00) runs over request and reply together.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalyref import modbus

if TYPE_CHECKING:
    from collections.abc import Callable

MODBUS, SINOWEALTH, PYLONTECH, JBD = "Modbus RTU", "Sinowealth", "Pylontech RS485", "JBD"
LONGEST = 4096
"""A run of more bytes is not named."""

_MAYBE, _DEAD = -1, -2


def crc8(data: bytes) -> int:
    """Return the CRC-8 with polynomial 07 and start 00."""
    value = 0
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = (value << 1 ^ 0x07 if value & 0x80 else value << 1) & 0xFF
    return value


def _modbus_lengths(data: bytes, at: int, end: int) -> list[int]:
    """Return the lengths the function at `at` allows, shortest first; one not yet known is the least it can be."""
    function = data[at + 1]
    if 0x01 <= function <= 0x04:
        count = data[at + 2] if end - at > 2 else 1
        return sorted((8, 5 + count)) if 1 <= count <= 250 else [8]
    if function in (0x05, 0x06):
        return [8]
    if function in (0x0F, 0x10):
        count = data[at + 6] if end - at > 6 else 1
        return [8, 9 + count] if 1 <= count <= 250 else [8]
    if 0x81 <= function <= 0x86 or function in (0x8F, 0x90):
        return [5]
    return []


def modbus_step(data: bytes, at: int, end: int) -> int:
    """Return where the frame at `at` ends, _MAYBE where bytes are missing, _DEAD where there is none."""
    if modbus.asks(data[at]) or modbus.answers(data[at]):
        return _DEAD
    if end - at < 2:
        return _MAYBE
    verdict = _DEAD
    for length in _modbus_lengths(data, at, end):
        if at + length > end:
            verdict = _MAYBE
        elif modbus.crc(data[at : at + length]) == 0:
            return at + length
    return verdict


def _asks(data: bytes, at: int, end: int) -> bool:
    """Tell whether the bytes at `at` fit a Sinowealth request as far as they go."""
    there = end - at
    return (
        (there < 1 or data[at] == 0x0A)
        and (there < 2 or 0x01 <= data[at + 1] <= 0x16)
        and (there < 3 or data[at + 2] in (2, 4))
    )


def sinowealth_step(data: bytes, at: int, end: int, *, ended: bool) -> int:
    """Return where the exchange at `at` ends: behind the reply, or behind the request when what follows is none."""
    if not _asks(data, at, end):
        return _DEAD
    behind = at + 3
    if end < behind:
        return _MAYBE
    stop = behind + data[at + 2] + 1
    if stop > end and not ended:
        return _MAYBE
    if stop <= end and crc8(data[at : stop - 1]) == data[stop - 1]:
        return stop
    return behind  # what follows must be another request, or nothing


_PYLONTECH_START, _PYLONTECH_END, _DIGITS = 0x7E, 0x0D, frozenset(b"0123456789ABCDEF")
PYLONTECH_HEAD: Final = 13
"""Bytes before what a Pylontech frame carries: 7E, version, address, two commands, length."""
JBD_HEAD: Final = 4
"""Bytes before what a JBD frame carries: DD, two that say what it is, length."""


def complement(data: bytes) -> int:
    """Return the two's complement of the sum of the bytes, 16 bits: the check of Pylontech and of JBD."""
    return -sum(data) & 0xFFFF


def pylontech_step(data: bytes, at: int, end: int) -> int:
    """Return where the frame at `at` ends, _MAYBE where bytes are missing, _DEAD where there is none."""
    if data[at] != _PYLONTECH_START:
        return _DEAD
    head = data[at + 1 : min(end, at + PYLONTECH_HEAD)]
    if not _DIGITS.issuperset(head):
        return _DEAD
    if len(head) < PYLONTECH_HEAD - 1:
        return _MAYBE
    check = at + PYLONTECH_HEAD + (int(head[-4:], 16) & 0x0FFF)
    if end < check + 5:
        return _MAYBE
    whole = data[at + 1 : check + 4]
    good = (
        data[check + 4] == _PYLONTECH_END
        and _DIGITS.issuperset(whole)
        and complement(whole[:-4]) == int(whole[-4:], 16)
    )
    return check + 5 if good else _DEAD


def jbd_step(data: bytes, at: int, end: int) -> int:
    """Return where the frame at `at` ends, _MAYBE where bytes are missing, _DEAD where there is none."""
    if data[at] != 0xDD:
        return _DEAD
    if end - at < JBD_HEAD:
        return _MAYBE
    check = at + JBD_HEAD + data[at + 3]
    if end < check + 3:
        return _MAYBE
    good = data[check + 2] == 0x77 and complement(data[at + 2 : check]) == int.from_bytes(data[check : check + 2])
    return check + 3 if good else _DEAD


_STEPS: dict[str, Callable[[bytes, int, int], int]] = {
    MODBUS: modbus_step,
    PYLONTECH: pylontech_step,
    JBD: jbd_step,
}
_MAKERS = (MODBUS, SINOWEALTH, PYLONTECH, JBD)


class Run:
    """Judges one run of bytes that may still grow. What was read once is not read again."""

    __slots__ = ("_done",)

    def __init__(self) -> None:
        self._done = dict.fromkeys(
            _MAKERS, 0
        )  # how far, from the run's beginning, it is this maker's; _DEAD: it is not

    def judge(self, data: bytes, start: int, end: int, *, ended: bool) -> str | None:
        """Name the run ``data[start:end]``; "" where it is nothing known, None where more bytes must tell.

        `ended` says that the run ends at `end`: then the answer is never None.
        """
        if end - start > LONGEST:
            self._done = dict.fromkeys(_MAKERS, _DEAD)
        open_still = False
        for name in _MAKERS:
            if (done := self._done[name]) != _DEAD:
                self._done[name] = done = self._walk(name, data, start, end, done, ended=ended)
                if ended and done == end - start:
                    return name
                open_still = open_still or done != _DEAD
        return None if open_still and not ended else ""

    @staticmethod
    def _walk(maker: str, data: bytes, start: int, end: int, done: int, *, ended: bool) -> int:
        step = _STEPS.get(maker)
        while 0 <= done < end - start:
            at = start + done
            stop = step(data, at, end) if step else sinowealth_step(data, at, end, ended=ended)
            if stop == _MAYBE:
                return _DEAD if ended else done
            done = stop - start if stop >= 0 else _DEAD
        return done
