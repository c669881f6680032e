# SPDX-License-Identifier: GPL-2.0-or-later
"""Ports, opened to listen and never to speak.

A serial device of Linux or macOS is opened by hand (dalycapture.device). ``socket://HOST:PORT`` is a TCP serial
server, ``rfc2217://HOST:PORT`` one with settings (dalycapture.remote, through pyserial, which talks to the server to
set it up). Windows goes through pyserial too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

from dalycapture.errors import PortError

if TYPE_CHECKING:
    from dalycapture.adapters import Adapter
    from dalycapture.line import Counts
    from dalycapture.settings import Settings

__all__ = ["Facts", "Latency", "Port"]

READ_SIZE: Final = 4096  # the kernel's line discipline holds no more


@dataclass(frozen=True, slots=True)
class Latency:
    """For how long bytes may be on their way from the wire to us, in ms, and how that is known.

    hold_ms: an adapter's buffer may hold a byte back for so long. way_ms: what the way to the computer adds. learns: it
    is an assumption, to be corrected by what is seen.
    """

    hold_ms: float
    way_ms: float
    source: str
    learns: bool = False

    def __str__(self) -> str:
        return f"{self.hold_ms:g} ms ({self.source})"


PROMPT: Final = Latency(0.0, 0.0, "pseudo-terminal", learns=True)
ASSUMED: Final = Latency(16.0, 1.0, "assumed", learns=True)
NETWORK: Final = Latency(50.0, 50.0, "assumed for a network", learns=True)


@dataclass(frozen=True, slots=True)
class Facts:
    """What was granted when a port was opened, for the file's description of the interface.

    marked: bytes come with marks of line errors (dalycapture.marks). remarks: what was granted, what is not known, a
    few words each. granted: the character format, as in Settings.
    """

    adapter: Adapter
    latency: Latency = ASSUMED
    marked: bool = False
    granted: str = ""
    remarks: tuple[str, ...] = ()


class Port(Protocol):
    """Something to listen to. ``fileno`` can be polled for reading."""

    name: str
    facts: Facts

    def fileno(self) -> int:
        """Return the descriptor to poll."""
        ...

    def read(self) -> bytes | None:
        """Read what is there, at most 4096 bytes; None: nothing yet. Raises PortError when the port is gone."""
        ...

    def counts(self) -> Counts | None:
        """Read the driver's error counters; None: there are none."""
        ...

    def close(self) -> None:
        """Close it."""
        ...


def gone(name: str, why: str = "") -> PortError:
    """Say that a port is not there any more."""
    advice = "check the network and the server" if "://" in name else "check the adapter and its cable"
    return PortError(f"{name} went away{f' ({why})' if why else ''}; {advice}, then start again")


def latency_of(adapter: Adapter, settings: Settings, default: Latency = ASSUMED) -> Latency:
    """Tell how long an adapter may hold bytes back: as the user says, as the system says, else assumed."""
    if settings.latency_ms is not None:
        return Latency(settings.latency_ms, default.way_ms, "as given")
    if adapter.latency_ms is not None:
        return Latency(adapter.latency_ms, default.way_ms, "latency timer")
    return default
