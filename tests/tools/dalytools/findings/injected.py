# SPDX-License-Identifier: GPL-2.0-or-later
"""Small captures with one thing wrong each, and a poll of which nothing is wrong: times and bytes by hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tests.meaning import a5, cells, extremes, status
from tests.meaning_modbus import brings, read

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalytools.comparison import read_alone
from dalytools.findings.search import Search

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dalyref.decoder import Options
    from dalytools.findings.finding import Finding
    from dalytools.findings.limits import Limits

EPOCH_NS = 1_700_000_000_000_000_000
PACK = a5(1, 0x90, "00c6000075300181")
"""19.8 V (six cells of 3.3 V), 0 A, 38.5 %."""
MOS_ON, MOS_OFF = a5(0x40, 0xD9, "01"), a5(0x40, 0xD9, "00")


@dataclass(frozen=True)
class Heard:
    """A packet: when (s), bytes as hex (none: an event), and what the capture says with it."""

    at: float
    data: str = ""
    comment: str = ""
    dropped: int = 0
    interface: int = 0


def capture(path: Path, packets: Sequence[Heard], descriptions: Sequence[str] = ("dalyshark bus=main",)) -> Path:
    with open_writer(path, application="test") as writer:
        for description in descriptions:
            writer.add_interface(Interface("made", description))
        for heard in packets:
            writer.write_packet(
                EPOCH_NS + round(heard.at * 1e9),
                bytes.fromhex(heard.data),
                interface=heard.interface,
                comment=heard.comment,
                dropped=heard.dropped,
            )
    path.chmod(0o644)
    return path


def search(path: Path, limits: Limits | None = None, options: Options | None = None) -> list[Finding]:
    watched = Search(limits)
    read_alone(path, options=options, listener=watched)
    return watched.findings()


def asked(at: float, data_id: int, *replies: str, host: int = 0x40, after: float = 0.05) -> list[Heard]:
    """A request, and its replies 50 ms and more behind it."""
    return [
        Heard(at, a5(host, data_id)),
        *(Heard(at + after + 0.0136 * number, reply) for number, reply in enumerate(replies)),
    ]


def poll(at: float) -> list[Heard]:
    """A poll of a pack of six cells in which nothing is wrong."""
    return [
        *asked(at, 0x90, PACK),
        *asked(at + 0.2, 0x91, extremes(3310, 2, 3290, 5)),
        *asked(at + 0.4, 0x94, status(6)),
        *asked(at + 0.6, 0x95, cells(1, 3300, 3310, 3300), cells(2, 3300, 3290, 3300)),
        *asked(at + 0.8, 0x98, a5(1, 0x98)),
    ]


def discharging(at: float, current: int) -> list[Heard]:
    """A pack of 16 cells under load (field notes, a.90: dpy-S1 has state 2 and raw 30500)."""
    return [
        *asked(at, 0x93, a5(1, 0x93, "020101")),
        *asked(at + 0.3, 0x90, a5(1, 0x90, f"020c0000{current:04x}0181")),
    ]


CLEAN = [heard for second in range(3) for heard in poll(second)]
LATER = [Heard(20, a5(0x40, 0x61)), Heard(20.05, a5(1, 0x61, "1801020304050607"))]
"""An exchange long after, so that what came before is settled."""
FAULTY, FINE = a5(1, 0x98, "0100000000000000"), a5(1, 0x98)
FOREIGN = "010300000001840a"
"""Modbus of slave 1: reads register 0; its CRC as every Modbus primer has it."""

SWITCH_000C = "d206000c00019baa"
"""The vendor's example: a write of 1 to 000C, and its CRC."""

CASES: dict[str, list[Heard]] = {
    "silent": [heard for second in range(3) for heard in asked(2 * second, 0x90, host=0x41)],
    "unanswered": [*CLEAN, Heard(5, a5(0x40, 0x62))],
    "unasked": [*CLEAN, Heard(5, a5(1, 0x97))],
    "late": [*CLEAN, *asked(5, 0x90, PACK, after=0.7)],
    "wrong-board": [*CLEAN, *asked(5, 0x90, a5(2, 0x90, "00c6000075300181"))],
    "two-hosts": [*CLEAN, *asked(5, 0x90, PACK), *asked(5.3, 0x93, a5(1, 0x93), host=0x80)],
    "echo": [*CLEAN, Heard(5, a5(0x40, 0x90)), Heard(5.03, a5(0x40, 0x90)), Heard(5.08, PACK)],
    "asleep": [
        *CLEAN,
        *(Heard(at + gap, a5(0x40, 0x90)) for at in (5.0, 7.0, 9.0) for gap in (0.0, 0.03)),
    ],
    "zero-reply": [*CLEAN, *asked(5, 0x90, a5(1, 0x90))],
    "burst-missing": [*CLEAN, *asked(5, 0x94, status(9)), *asked(5.2, 0x95, cells(1, 1, 2, 3), cells(3, 7, 8, 9))],
    "burst-repeat": [*CLEAN, *asked(5, 0x95, *(cells(n, 3300, 3300, 3300) for n in (1, 1, 2)))],
    "burst-cut-off": [*CLEAN, *asked(5, 0x95, cells(1, 3300, 3310, 3300))],
    "burst-length": [
        *asked(0, 0x95, *(cells(n, 3300, 3300, 3300) for n in (1, 2))),
        *asked(1, 0x95, *(cells(n, 3300, 3300, 3300) for n in (1, 2))),
        *asked(2, 0x95, *(cells(n, 3300, 3300, 3300) for n in (1, 2, 3))),
    ],
    "contradiction": [*CLEAN, *asked(5, 0x91, extremes(3400, 2, 3290, 5))],
    "fault-raised": [*CLEAN, *asked(5, 0x98, FAULTY), *asked(6, 0x98, FINE)],
    "fault-standing": asked(0, 0x98, FAULTY),
    "write": [*CLEAN, Heard(5, MOS_ON), Heard(5.05, a5(1, 0xD9, "01"))],
    "write-denied": [*CLEAN, Heard(5, MOS_OFF), Heard(5.05, a5(1, 0xD9, "01"))],
    "write-unconfirmed": [*CLEAN, Heard(5, MOS_OFF)],
    "damaged": [*CLEAN, Heard(5, "00112233445566778899aabbccdd"), *asked(6, 0x90, PACK)],
    "foreign": [*CLEAN, Heard(5, FOREIGN), *asked(6, 0x90, PACK)],
    "unknown-id": [*CLEAN, *asked(5, 0xC1, a5(1, 0xC1))],
    "current-sign": [heard for second in range(3) for heard in discharging(second, 30500)],
    "stale-slots": [
        *asked(0, 0x94, status(4)),
        *asked(1, 0x95, cells(1, 3300, 3310, 3300), cells(2, 3290, 3301, 3302)),
    ],
    "absent-registers": [Heard(0, read(0x63, 2)), Heard(0.05, brings(0xFFFF, 0xFFFF))],
    "read-short": [Heard(0, read(0, 0x3E)), Heard(0.05, brings(*[3300] * 4, *[0] * 36, 132, 30000, 500, *[0] * 19))],
    "write-no-switch": [*CLEAN, Heard(5, SWITCH_000C), Heard(5.05, SWITCH_000C)],
    "write-no-effect": [
        *CLEAN,
        Heard(5, MOS_OFF),
        Heard(5.05, a5(1, 0xD9, "00")),
        *asked(8, 0x93, a5(1, 0x93, "000101")),
    ],
    "port-lost": [*CLEAN, Heard(5, comment="port lost: the adapter was unplugged")],
    "line-errors": [*CLEAN, Heard(5, comment="line errors: 2 bytes marked, driver counts framing errors 2")],
    "dropped": [*CLEAN, Heard(5, a5(0x40, 0x61), dropped=4), Heard(5.05, a5(1, 0x61))],
    "clock-step": [*CLEAN, *asked(1, 0x90, PACK)],
}
"""Rule: a capture that breaks it."""

BESIDES: dict[str, set[str]] = {
    "silent": {"unanswered"},
    "asleep": {"echo", "unanswered"},
    "clock-step": {"late", "unanswered"},
    "write-denied": {"write"},
    "write-no-switch": {"write"},
    "write-no-effect": {"write"},
    "write-unconfirmed": {"write", "unanswered"},
}
"""What the same capture breaks too: a silent board's requests are unanswered, and the like."""
