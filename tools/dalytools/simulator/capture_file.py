# SPDX-License-Identifier: GPL-2.0-or-later
"""A scenario straight into a capture, as fast as the machine can, on any wire; and the truth about it beside."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from dalycapture.create import new_capture
from dalycapture.errors import CaptureError
from dalytools import __version__
from dalytools.problem import Problem
from dalytools.progress import progress_bar
from dalytools.simulator.bus import Bus
from dalytools.simulator.truth import Truth
from dalytools.simulator.wire_ble import BleWire
from dalytools.simulator.wire_can import CanWire
from dalytools.simulator.wire_tcp import TcpWire
from dalytools.simulator.wire_uart import UartWire
from dalytools.whole_file import whole_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    from dalytools.simulator.scenario import Scenario
    from dalytools.simulator.sent import Sent
    from dalytools.simulator.wire import Wire, WirePacket

WIRES: Final[dict[str, Callable[[Scenario], Wire]]] = {
    "uart": UartWire,
    "can": CanWire,
    "ble": BleWire,
    "tcp": TcpWire,
}


class Written(NamedTuple):
    """What a capture got: packets, bytes on the wire, seconds of bus time, and the truth."""

    packets: int
    wire_bytes: int
    end_ns: int
    truth: Truth


def heard(bus: Bus, until_ns: int) -> Iterator[Sent]:
    """All that is heard on a bus up to that time; what began before it is whole."""
    while bus.now_ns < until_ns:
        yield from bus.poll()
    bus.pass_time(until_ns)


def write_capture(
    scenario: Scenario,
    path: Path | str,
    *,
    wire: str = "",
    seconds: float = 0.0,
    file_format: Literal["pcapng", "pcap"] = "pcapng",
    truth: Path | str | None = None,
) -> Written:
    """Write the scenario's traffic. wire, seconds: the scenario's own where none is given. Raises Problem."""
    wire = wire or scenario.wire
    until_ns = int((seconds or scenario.duration_s) * 1e9)
    bus = Bus(scenario, truth=Truth(on=truth is not None))
    carrier = WIRES[wire](scenario)
    packets = size = last_ns = 0
    end_ns = until_ns
    try:
        with (
            new_capture(path, file_format, application=f"dalyshark {__version__}") as writer,
            progress_bar("simulate") as advance,
        ):
            writer.origin = f"made by dalyshark simulate, seed {scenario.seed}"
            interface = writer.add_interface(carrier.interface)

            def put(made: Iterable[WirePacket]) -> None:
                nonlocal packets, last_ns
                for packet in made:
                    last_ns = max(last_ns, scenario.start_ns + packet.time_ns)  # roundings apart, they are in order
                    writer.write_packet(last_ns, packet.data, interface=interface, flags=packet.flags)
                    packets += 1
                    if packets % 1024 == 0:
                        advance(packets)

            for piece in heard(bus, until_ns):
                size += len(piece.data)
                end_ns = max(end_ns, piece.time_ns + bus.wire_ns(piece.data))
                put(carrier.feed(piece))
            put(carrier.finish(until_ns))
    except CaptureError as error:
        raise Problem(str(error)) from None
    if truth is not None:
        with whole_file(str(truth)) as out:
            bus.truth.write(out, scenario, wire=wire, end_ns=end_ns)
    return Written(packets, size, end_ns, bus.truth)
