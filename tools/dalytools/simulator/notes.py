# SPDX-License-Identifier: GPL-2.0-or-later
"""What the bus notes down of an exchange, for the truth (truth.py says what there is)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalytools.simulator import modbus
from dalytools.simulator.board import LIE_IDS, START, is_request

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalytools.simulator.scenario import Event
    from dalytools.simulator.sent import Sent
    from dalytools.simulator.tampering import Tampered
    from dalytools.simulator.truth import Truth


class Notes:
    """Takes notes of requests and replies. now: the bus's time, ns."""

    def __init__(self, truth: Truth, now: Callable[[], int]) -> None:
        self._truth = truth
        self._now = now
        self._told: dict[tuple[str, int], frozenset[str]] = {}

    def unanswered(self, request: bytes, sender: str, at_ns: int, why: str) -> None:
        """Note a request that got no good reply. at_ns: when it began."""
        if self._truth.on:
            address, first = (request[1], 0x40) if request[0] == START else (request[0], modbus.ASKS_81 + 1)
            facts = {"host": sender, "address": address, **about(request), "why": why}
            board = address - first + 1
            if 1 <= board <= 16:
                facts["board"] = board
            self._truth.note(at_ns, "unanswered", **facts)

    def write(self, request: bytes, sender: str, at_ns: int, replies: list[Sent]) -> None:
        """Note a request that writes, and what the first reply made of it."""
        heard = [piece.data for piece in replies if piece.sender.startswith("board")]
        reply = heard[0] if heard else b""
        if request[0] == START:
            data_id, same = request[2], reply[4:12] == request[4:12]
            if data_id in {0xD9, 0xDA}:  # states: any byte but 00 is on
                result = "confirmed" if any(reply[4:5]) == any(request[4:5]) else "denied"
            elif data_id == 0x21:
                taken = {b"\x01": "confirmed", b"\x00": "denied"}
                result = "answered" if same else taken.get(reply[4:5], "answered")
            else:
                result = "confirmed" if same and data_id else "answered"
            facts = {"dialect": "a5", "data_id": data_id, "value": request[4:12].hex()}
        else:
            result = "confirmed" if reply[1:2] == request[1:2] and reply[2:6] == request[2:6] else "denied"
            dialect = "d2" if request[0] == modbus.D2 else "81"
            facts = {"dialect": dialect, "register": int.from_bytes(request[2:4]), "value": request[4:-2].hex()}
        self._truth.note(at_ns, "write", host=sender, **facts, result=result if reply else "none")

    def late(self, number: int, request: bytes, meant_ns: int, tampered: list[Tampered], *, zero: bool) -> None:
        """Note an answer that begins late. meant_ns: when it would have begun; zero: it is one of waking up."""
        self._truth.note(self._now(), "late", board=number, delay_s=(self._now() - meant_ns) / 1e9, **about(request))
        if zero:
            self._truth.note(self._now(), "zero_reply", board=number, **about(request))
        self.tampered(number, request, tampered)

    def tampered(self, number: int, request: bytes, tampered: list[Tampered]) -> None:
        """Note what is done to an answer that begins now."""
        for what, facts in tampered:
            self._truth.note(self._now(), what, board=number, data_id=request[2], **facts)

    def said(
        self, number: int, request: bytes, frames: list[bytes], tricks: list[Event], faults: frozenset[str] | None
    ) -> None:
        """Note what a good reply says: contradictions, and faults where it tells them (None: it does not)."""
        for event in tricks:
            if event.what == "contradict" and LIE_IDS.get(event.name) == request[2]:
                self._truth.note(self._now(), "contradiction", board=number, name=event.name, **about(request))
        if faults is not None:
            self.faults(number, request, frames, faults)

    def faults(self, number: int, request: bytes, frames: list[bytes], faults: frozenset[str]) -> None:
        """Note what a good reply with the fault bits tells that the one before it did not."""
        if not self._truth.on:
            return
        if request[0] == START:
            if request[2] != 0x98 or frames[0][2] != 0x98:
                return
            key = ("a5", number)
        else:
            asked = modbus.parse(request)
            if asked is None or asked.writes or asked.address != modbus.D2:
                return
            if asked.register > 0x3A or asked.register + asked.count < 0x3E:
                return
            key = ("d2", number)
        before = self._told.get(key)
        self._told[key] = faults
        changes = [("fault_present" if before is None else "fault_raised", faults - (before or frozenset()))]
        if before is not None:
            changes.append(("fault_cleared", before - faults))
        for what, names in changes:
            for name in sorted(names):
                self._truth.note(self._now(), what, board=number, name=name, dialect=key[0])


def about(request: bytes) -> dict[str, int]:
    """Return what was asked for."""
    if is_request(request) or request[:1] == bytes((START,)):
        return {"data_id": request[2]}
    return {"register": int.from_bytes(request[2:4])}
