# SPDX-License-Identifier: GPL-2.0-or-later
"""What the writers of pcapng and of classic pcap have in common: packets counted, and none lost in silence."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Self

from dalycapture.errors import CaptureError
from dalycapture.output import Output, reason

if TYPE_CHECKING:
    from types import TracebackType

    from dalycapture.interface import Interface


class CaptureWriter(ABC):
    """Writes one capture. Every packet reaches the output before ``write_packet`` returns.

    ``written`` and ``lost`` count packets with bytes in them (records); events are not counted. ``failure`` is what
    broke the output.
    """

    def __init__(self, output: Output) -> None:
        self.output = output
        self.written = 0
        self.lost = 0
        self.failure: OSError | None = None
        self._dropped = 0  # since the last packet that went out

    @abstractmethod
    def add_interface(self, interface: Interface) -> int:
        """Describe an interface; the number that its packets carry, from 0. Raises CaptureError."""

    @abstractmethod
    def _packet(self, time_ns: int, data: bytes, *, interface: int, flags: int, comment: str, dropped: int) -> bytes:
        """Lay out one packet."""

    def write_packet(
        self,
        time_ns: int,
        data: bytes,
        *,
        interface: int = 0,
        flags: int = 0,
        comment: str = "",
        dropped: int = 0,
    ) -> None:
        """Write one packet; without bytes it is an event.

        time_ns: nanoseconds since 1970 (UTC); flags: see pcapng's ``epb_flags``; dropped: what the port lost before it.
        Raises CaptureError, which says how many records are safe and how many are lost, when the output broke; the
        output then ends in a whole block.
        """
        self._dropped += dropped
        block = self._packet(time_ns, data, interface=interface, flags=flags, comment=comment, dropped=self._dropped)
        records = 1 if data else 0
        if self._write(block, records):
            self.written += records
            self._dropped = 0
        else:
            self.lost += records
            self._dropped += records

    @abstractmethod
    def write_statistics(
        self, interface: int, *, start_ns: int, end_ns: int, received: int, dropped: int, os_dropped: int = 0
    ) -> None:
        """Write the interface's counts so far, where the format has a place for them.

        received, dropped: records that came, and those that no file has; os_dropped: losses before us, in the kernel or
        the UART.
        """

    def rotate(self) -> None:  # noqa: B027 - most have no next file
        """Go on in the next file, where there is one: the user asks for it (SIGUSR1)."""

    def tick(self) -> None:  # noqa: B027 - most do nothing by time
        """Do what is due by time. Called about once a second, on a silent bus too."""

    def _write(self, block: bytes, records: int = 0) -> bool:
        try:
            return self.output.write(block)
        except OSError as error:
            self.lost += records
            self.failure = error
            raise self.broken() from error

    def hand_on(self) -> None:
        """Hand on what waits for a slow reader, as far as it takes it. Raises CaptureError when it went away."""
        try:
            self.output.pump()
        except OSError as error:
            self.failure = error
            raise self.broken() from error

    def broken(self) -> CaptureError:
        """Say what happened to the output, and to the records."""
        if isinstance(self.failure, BrokenPipeError):
            why, advice = "its reader went away", "start the reader again"
        else:
            why = reason(self.failure) if self.failure else "can not be written"
            advice = "free some space, or write elsewhere"
        return CaptureError(
            f"{self.output.name}: {why}; {counted(self.written, 'record')} written, {self.lost} lost; {advice}"
        )

    def close(self) -> None:
        """Close the output."""
        self.output.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def counted(number: int, what: str) -> str:
    """``1 record``, ``2 records``."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
