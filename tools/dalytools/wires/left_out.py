# SPDX-License-Identifier: GPL-2.0-or-later
"""What a capture holds and a reading leaves out, counted, in words for people and for programs."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from dalytools.terminal_text import counted, plain

if TYPE_CHECKING:
    from collections.abc import Iterable

What = Literal["tcp_connections", "tcp_records", "ble_values", "ble_packets"]

_WORDS: dict[What, tuple[str, str]] = {
    "tcp_connections": (
        "TCP connection",
        (
            "not compared: where a capture has lost segments, Wireshark can't show well those that came late or twice, "
            "nor a frame in pieces one of which the snap length cut off"
        ),
    ),
    "tcp_records": (
        "incomplete TCP record",
        "not compared: its end is lost, cut off or not in the capture, and Wireshark may show a TCP segment",
    ),
    "ble_packets": ("Bluetooth packet", "left out: a piece of it is missing, or was cut off by the snap length"),
    "ble_values": (
        "Bluetooth value",
        (
            "left out: no frame of Daly's had come by then (other makers use attributes fff1, fff2, ff01 and ff02 too; "
            "--ble-handles takes an attribute from its first value on)"
        ),
    ),
}
"""What is counted, and why it is left out."""


@dataclass(frozen=True, slots=True)
class LeftOut:
    """So many of a kind."""

    what: What
    count: int

    def __str__(self) -> str:
        one, why = _WORDS[self.what]
        return f"{counted(self.count, one)} {why}"


def say(command: str, file: str, left_out: Iterable[LeftOut]) -> None:
    """Tell people, a line each, on standard error."""
    for one in left_out:
        print(f"dalyshark {command}: {plain(file)}: {one}", file=sys.stderr)  # noqa: T201
