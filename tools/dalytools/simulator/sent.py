# SPDX-License-Identifier: GPL-2.0-or-later
"""What is heard on the simulated bus, and what a request leads to."""

from __future__ import annotations

from typing import NamedTuple


class Sent(NamedTuple):
    """Bytes on the wire: when their first bit begins (ns of bus time), who sends them, and what is heard."""

    time_ns: int
    sender: str  # "host", "client", "board 3"
    data: bytes


class Exchange(NamedTuple):
    """What a request led to: all that was heard, whether the host takes it as answered, and when the request ended."""

    sent: list[Sent]
    answered: bool
    request_end_ns: int
