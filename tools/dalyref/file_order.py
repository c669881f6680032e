# SPDX-License-Identifier: GPL-2.0-or-later
"""From the packets of a file to their records, in the order of the file (docs/records.md, sections 1 and 12).

    packets -> streams (cut, time) -+-> held while a stream may still give an earlier one -> out
    others  ------------------------+

Memory is bounded whatever the capture holds: see the limits below.
"""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING, Generic, TypeVar

from dalyref.options import NANO
from dalyref.streams import Located, Stream

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dalyref.options import Options
    from dalyref.packet import Direction, Packet, Transport

# Packets of several interfaces are not strictly in the order of their times. Whether something has been given up by
# time is therefore decided a little later than the rule would have it.
LATE_NS = 10 * NANO
# What a hostile capture may make us hold.
MOST_HELD = 65536
MOST_STREAMS = 4096
_MOST_WAITING_STREAMS = 64

StreamKey = tuple[int | str, str]
"""Interface, or connection; and direction."""

T = TypeVar("T")


class FileOrder(Generic[T]):
    """Cuts streams, and keeps their records in the order of the file, with others (T) that need no cutting."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self._streams: dict[StreamKey, Stream] = {}
        self._waiting: dict[StreamKey, Stream] = {}  # those that hold bytes
        self._ordered: list[tuple[int, int, Located | T]] = []  # heap by packet number and place
        self._place = 0

    @property
    def idle(self) -> bool:
        """Tell whether no byte is held: what comes next depends on no packet before, but for silence."""
        return not self._waiting and not self._ordered

    def feed(self, packet: Packet) -> None:
        """Take the next packet of a serial line, of Bluetooth or TCP."""
        serial = packet.transport == "uart"
        key = (packet.interface if serial else packet.connection, packet.direction)
        stream = self._stream(key, packet.transport)
        self._order(stream.feed(packet))
        if serial and not packet.data:
            self._order((Located(None, packet, packet.time_ns, packet.time_ns),))
        if stream.waits_from is not None:
            self._waiting[key] = stream
        else:
            self._waiting.pop(key, None)
        if len(self._waiting) > (key in self._waiting) or len(self._ordered) > MOST_HELD:
            self._give_up(key, packet.time_ns)

    def put(self, number: int, time_ns: int, item: T) -> None:
        """Take what is a record by itself, from packet `number`."""
        self._place += 1
        heapq.heappush(self._ordered, (number, self._place, item))
        if len(self._ordered) > MOST_HELD:
            self._give_up(None, time_ns)

    def passed(self, interface: int, direction: Direction, count: int, end_ns: int) -> None:
        """Take note of `count` bytes of a serial line that were whole frames and did not come this way.

        Nothing may be held (``idle``), and none of the frames may hold the beginning of another window.
        """
        self._stream((interface, direction), "uart").passed(count, end_ns)

    def released(self) -> Iterator[Located | T]:
        """Yield what no record still to come can precede."""
        ordered = self._ordered
        if not self._waiting:
            barrier = None
        else:
            barrier = min(number for stream in self._waiting.values() if (number := stream.waits_from) is not None)
        while ordered and (barrier is None or ordered[0][0] <= barrier):
            yield heapq.heappop(ordered)[2]

    def finish(self) -> Iterator[Located | T]:
        """Take the end of the file; yield all that was held."""
        for stream in self._streams.values():
            self._order(stream.flush())
        self._waiting.clear()
        yield from self.released()

    def _stream(self, key: StreamKey, transport: Transport) -> Stream:
        stream = self._streams.get(key)
        if stream is None:
            if len(self._streams) >= MOST_STREAMS:
                oldest = next(iter(self._streams))
                self._waiting.pop(oldest, None)
                self._order(self._streams.pop(oldest).flush())
            stream = self._streams[key] = Stream(self._options, transport)
        return stream

    def _order(self, located: Iterable[Located]) -> None:
        for item in located:
            self._place += 1
            heapq.heappush(self._ordered, (item.packet.number, self._place, item))

    def _give_up(self, present: StreamKey | None, time_ns: int) -> None:
        """Flush streams that have been silent for long, so that they do not hold up the others."""
        late = [key for key, stream in self._waiting.items() if key != present and stream.silent_at(time_ns, LATE_NS)]
        if len(self._waiting) - len(late) > _MOST_WAITING_STREAMS or len(self._ordered) > MOST_HELD:
            late += [key for key in self._waiting if key not in late][:1]
        for key in late:
            self._order(self._waiting.pop(key).flush())
