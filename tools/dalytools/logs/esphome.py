# SPDX-License-Identifier: GPL-2.0-or-later
r"""ESPHome's log of ``uart: debug:`` (its component uart, UARTDebug::log_hex, log_int, log_string).

    [21:57:14][D][uart_debug:114]: >>> A5:40:90:08:00:00:00:00:00:00:00:00:7D       >>> sent by the ESP
    [20:03:02.908][D][uart_debug:113]: [UART] <<< A5 01 90 08                      <<< received
    [17:28:17][D][uart_debug:158]: <<< "\xa5\x01.."                                log_string
    [17:28:17][D][uart_debug:176]: <<< 165,1,144,8                                 log_int
    2026-01-01 12:00:00.123 DEBUG (MainThread) [homeassistant.components.esphome.manager] bms: [D][uart_debug:114]: ..

Separators as set (: , blank). log_hex has two digits a byte: a line that has others is decimal, and so is what follows
with the same separator. Times are those of the line's printing, behind the last byte, mostly to the second. Lines
of other components are known and left out. Source: lines in esphome/issues and in many public logs.
"""

from __future__ import annotations

import re

from dalytools.logs.entry import IN, OUT, Entry, PlainLineLog
from dalytools.logs.hexbytes import hex_bytes, literal_bytes
from dalytools.logs.stamps import split_stamp

_UART = re.compile(
    r".{0,200}?\[[A-Z]+\]\s*\[uart_debug:\d+\]\s*:?\s*(?:\[[^\]]{0,40}\]\s*)?(?P<way>>>>|<<<|>>|<<)\s*(?P<rest>.*)"
)
_OTHER = re.compile(r".{0,200}?\[(?:E|W|I|C|D|V|VV|S)\]\s*\[[\w.:-]{1,60}\]")
_NOTES = re.compile(r"\s*(?:INFO|WARNING|ERROR|DEBUG) ")
_DECIMAL = re.compile(r"(?:0|[1-9]\d{0,2})(?:(?P<mark>[,: ;-])(?:0|[1-9]\d{0,2})(?:(?P=mark)(?:0|[1-9]\d{0,2}))*)?")


class EspHome(PlainLineLog):
    """ESPHome's log."""

    name = "esphome"
    about = "ESPHome's uart debug lines: [12:34:56][D][uart_debug:114]: >>> A5:40:.."
    stamped_at_end = True

    def __init__(self) -> None:
        self._decimal = ""  # the separator of bytes in decimal

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line."""
        stamp, rest = split_stamp(line)
        found = _UART.match(rest)
        if found:
            text = found["rest"].strip()
            data = literal_bytes("b" + text) if text.startswith('"') else self._bytes(text)
            direction = OUT if found["way"].startswith(">") else IN
            return None if data is None else [Entry(data, stamp, direction)]
        return [] if _OTHER.match(rest) or _NOTES.match(line) else None

    def _bytes(self, text: str) -> bytes | None:
        found = _DECIMAL.fullmatch(text)
        if not found:
            return hex_bytes(text)
        parts = text.split(found["mark"])
        if all(len(part) == 2 for part in parts) and not (self._decimal and found["mark"] in {None, self._decimal}):
            return hex_bytes(text)
        if max(map(int, parts)) > 255:
            return None
        self._decimal = found["mark"] or self._decimal
        return bytes(map(int, parts))
