# SPDX-License-Identifier: GPL-2.0-or-later
"""The rules, with what each means: names and severities that configuration files and baselines depend on.

What the records say of each other (unanswered, late, bursts, contradictions) is worked out in docs/records.md; a rule
here groups it and says it in words. Severities: error where bytes or values are wrong for sure, or nothing works;
warning where a person must look; note where something is merely good to know.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dalytools.findings.finding import Finding, Severity

if TYPE_CHECKING:
    from dalytools.findings.finding import Tally
    from dalytools.findings.place import Place

_NOTE, _WARNING, _ERROR = Severity.NOTE, Severity.WARNING, Severity.ERROR


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule: its stable name, how bad a break of it is, what it means, and what to do."""

    name: str
    severity: Severity
    means: str
    advice: str


RULES: dict[str, Rule] = {
    name: Rule(name, severity, means, advice)
    for name, severity, means, advice in (
        # Both readings
        (
            "dissector-differs",
            _ERROR,
            "the Wireshark dissector and the reference decoder read a field differently",
            "one of the two has a defect: report it with the capture",
        ),
        # Requests and replies (records.md 6, 7)
        (
            "silent",
            _ERROR,
            "an address was asked three times or more and never answered",
            "check power, wiring (A and B), baud rate and the address",
        ),
        (
            "unanswered",
            _WARNING,
            "requests for an ID or a register got no reply in time",
            "a board does not answer IDs that it does not know, and says nothing of it: see whether it answers others",
        ),
        (
            "unasked",
            _WARNING,
            "replies came that no request on this bus belongs to",
            "look for a host that the tap does not hear, and for answers repeated on their way",
        ),
        (
            "late",
            _WARNING,
            "replies came later than the limit (--late-after), or after their request had been given up",
            "give the client a longer time-out, or poll more slowly",
        ),
        (
            "wrong-board",
            _ERROR,
            "another board answered than the one that was asked",
            "give every board on the bus a number of its own; a client must compare the address of the reply",
        ),
        (
            "two-hosts",
            _WARNING,
            "two hosts ask on one bus within a second: their requests and the replies can collide",
            "let one host poll, or put the second on a port of its own",
        ),
        (
            "echo",
            _WARNING,
            "requests came back unchanged: a sleeping board, or an adapter that hears itself",
            "a client must not read such a frame as a reply: it would show 0 V, -3000 A and -40 C",
        ),
        (
            "asleep",
            _WARNING,
            "a board only echoes, or answered and then fell silent, at the end or for a while: it sleeps",
            "wake it with the button, the key pin, or current; RS-485 alone does not wake it",
        ),
        (
            "zero-reply",
            _WARNING,
            "replies that are all zero, as boards send after waking up",
            "a client must drop readings of 0 V with SOC 0 %, and ask again",
        ),
        # Answers in several frames (records.md 8)
        (
            "burst-missing",
            _WARNING,
            "frames are missing inside an answer of several frames",
            "values behind the hole belong to other cells than their place says: a client must use the frame number",
        ),
        (
            "burst-repeat",
            _WARNING,
            "a frame came twice inside an answer of several frames",
            "a client must place cells by frame number, not by order",
        ),
        (
            "burst-cut-off",
            _WARNING,
            "an answer of several frames stopped before its last cell or sensor",
            "ask more slowly: boards stop where the next request comes; look for damaged bytes beside it",
        ),
        (
            "burst-length",
            _WARNING,
            "answers of several frames to the same request changed their number of frames",
            "do not wait for a fixed number of frames: end by quiet time or by the next ID",
        ),
        # Values (records.md 9, 11)
        (
            # No error: between two replies the load can step, and step back before the next 0x90 tells of it.
            "contradiction",
            _WARNING,
            "two replies of a board say different things about the same moment",
            "compare both packets: one is stale, damaged on its way, of another board, or the load stepped in between",
        ),
        (
            "fault-raised",
            _WARNING,
            "a fault bit went from 0 to 1 during the capture",
            "see what the battery did at that time: dalyshark decode shows the records around the packet",
        ),
        (
            "fault-standing",
            _WARNING,
            "a fault bit was set from the first fault reply on",
            "the fault is older than the capture: look at the battery",
        ),
        # What is right, and easily read wrongly
        (
            "current-sign",
            _NOTE,
            "what the sign of the current means on this board: it is not the same on all of them",
            "set the client's sign for this board, or take the direction from 0x93, which says it in words",
        ),
        (
            "stale-slots",
            _NOTE,
            "frames of cells hold old bytes behind the last cell, which a client may take for more cells",
            "a client must take the number of cells from 0x94, and drop what is behind",
        ),
        (
            "absent-registers",
            _NOTE,
            "registers were read that the board does not have: it answers FFFF, not with an exception",
            "drop them, or read them in the board's other dialect: the maps of D2 and 81 differ",
        ),
        (
            "read-short",
            _NOTE,
            "a program reads too few registers for all that a D2 board reports",
            "read 80 registers (0000 x 0050); a Bluetooth module hardly brings more at once",
        ),
        # Writes (records.md 10)
        ("write", _NOTE, "a request that changes something was seen", "make sure that you know who sent it"),
        (
            "write-denied",
            _ERROR,
            "a board answered a write with another value than was written, or with an exception",
            "read the value back; the board may refuse it, or need another register",
        ),
        (
            "write-unconfirmed",
            _WARNING,
            "a write got no reply",
            "read the value back before relying on it",
        ),
        (
            "write-no-switch",
            _WARNING,
            "a write went to a register that holds a reading: it is echoed, and changes nothing",
            "write the register that is the setting: D2 00A5 charge MOS, 00A6 discharge MOS, 00A7 SOC; 81 0121, 0122",
        ),
        (
            "write-no-effect",
            _WARNING,
            "a board confirmed that it switched a MOS, and went on saying that it is as before",
            "the echo does not prove that a value was taken: read back; a protection may hold the MOS open",
        ),
        # What else is on the wire
        (
            "damaged",
            _WARNING,
            "more bytes than the limit (--damaged-limit) belong to no good frame (below the limit: a note)",
            "check ground, termination, cable length and baud rate; see whether two devices speak at once",
        ),
        (
            "foreign",
            _WARNING,
            "traffic of another protocol is on the bus",
            "take the other device off the bus, or use the program that is made for it",
        ),
        (
            "not-polled",
            _WARNING,
            "frames are on the CAN bus, and nobody asks a board of Daly's: such a board speaks only when it is asked",
            "start the program that asks; compare bit rates: 250 kbit/s for Daly's own dialect, 500 for most inverters",
        ),
        (
            "unknown-id",
            _NOTE,
            "data IDs that no paper and no public program names",
            "find out what they are, and tell us: docs/protocol.md lists what is known",
        ),
        (
            "other-dialect",
            _WARNING,
            "requests in one dialect stay unanswered while a board answers in another",
            "set the client to the dialect that is answered",
        ),
        (
            "modbus-exception",
            _WARNING,
            "a board answered with a Modbus exception",
            "the register or the count is not one that this board knows",
        ),
        (
            "modbus-ambiguous",
            _WARNING,
            "a Modbus reply fits several requests that were under way: which registers it holds can't be told",
            "wait for each reply before sending the next request of the same length",
        ),
        # The capture itself
        (
            "line-errors",
            _WARNING,
            "the adapter saw framing errors, parity errors or breaks; on CAN, the controller sent error frames",
            "check baud rate, ground and termination; see whether two devices speak at once",
        ),
        (
            "port-lost",
            _WARNING,
            "the capture has a gap: the port was lost, or the computer slept",
            "nothing is known of that time; check the adapter and its cable",
        ),
        (
            "dropped",
            _WARNING,
            "the sniffer, the adapter or the kernel lost bytes or packets",
            "missing frames near it may have been on the wire; use a faster machine or adapter",
        ),
        (
            "clock-step",
            _WARNING,
            "the clock of the capture stepped, or times run backwards",
            "times on both sides of it can't be compared",
        ),
    )
}


def found(
    name: str,
    place: Place,
    tally: Tally,
    text: str,
    *,
    advice: str = "",
    severity: Severity | None = None,
    examples: tuple[str, ...] = (),
) -> Finding:
    """Make a finding by a rule; what is not given is the rule's."""
    rule = RULES[name]
    return Finding(
        name, rule.severity if severity is None else severity, place, tally, text, advice or rule.advice, examples
    )
