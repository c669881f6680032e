# SPDX-License-Identifier: GPL-2.0-or-later
"""The dissector's view of a capture and the reference decoder's, side by side.

    tshark -2 -T fields, one row a packet  --+
                                             +--> differences: packet, field, both values
    reference decoder, records             --+

A second tshark reads the file once, as a live view does: only for errors of Lua, which the first of two passes hides.

Records are compared packet by packet: all values of a field in a packet, in order. Cut-off frames and junk may be
divided differently by packets and silence (docs/records.md 4): of those, what lies between two other records is put
together first, and its bytes compared.
"""

from __future__ import annotations

import contextlib
import math
import subprocess
import threading
from collections import deque
from dataclasses import dataclass, field
from typing import IO, TYPE_CHECKING, Protocol

from dalycapture.errors import CaptureError
from dalycapture.linktype import DALY_LINK_TYPES, TAKEN_LINK_TYPE, link_type_name
from dalycapture.reader import read_capture
from dalyref.decoder import Decoded, Decoder, Options
from dalyref.records import Splitter
from dalytools.field_names import FIELD_NAMES
from dalytools.problem import Problem
from dalytools.tshark import Tshark, lua_complaint
from dalytools.wire_times import preferences
from dalytools.wires import choice
from dalytools.wires.carriers import NOT_READ, Carriers
from dalytools.wires.choice import Choice
from dalytools.wires.left_out import LeftOut

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
    from pathlib import Path

    from dalyref.packet import Packet

_BETWEEN_FIELDS, _BETWEEN_VALUES = "\t", "\x1f"
_REST_KINDS = ("junk", "short")
_UNDECODED = FIELD_NAMES.index("daly.undecoded")
_KIND = FIELD_NAMES.index("daly.kind")
_TRANSPORT = FIELD_NAMES.index("daly.transport")
_LUA_ERROR, _EXPERT = "_ws.lua.error", "_ws.expert.message"
_COLUMNS = len(FIELD_NAMES) + 3
_TIMES = frozenset({"daly.response_time"})
_TIME_TOLERANCE_S = 2e-6  # the dissector calculates in floating point from the start of the capture
_MOST_SHOWN = 1000
_MOST_REST = 1 << 20

Key = tuple[int | str, str]


@dataclass(frozen=True, slots=True)
class Difference:
    """One field of one packet that the two readings see differently. packet: as Wireshark counts, 0: the whole file."""

    packet: int
    field: str
    dissector: str
    reference: str

    def __str__(self) -> str:
        return f"packet {self.packet}  {self.field}: dissector {self.dissector}, reference {self.reference}"


@dataclass(slots=True)
class Comparison:
    """What came out. ``differences`` holds the first thousand; ``found`` counts all."""

    records: int = 0
    packets: int = 0
    kinds: dict[str, int] = field(default_factory=dict[str, int])
    found: int = 0
    differences: list[Difference] = field(default_factory=list[Difference])
    broken: str = ""
    """One line, when the capture could be read only in part."""
    left_out: list[LeftOut] = field(default_factory=list[LeftOut])
    """What was not read or not compared."""

    def add(self, difference: Difference) -> None:
        """Note a difference."""
        self.found += 1
        if len(self.differences) < _MOST_SHOWN:
            self.differences.append(difference)


@dataclass(slots=True)
class _Rest:
    """Cut-off frames and junk of one stream as one reading sees them, in pieces between other records."""

    pieces: deque[tuple[int, str]] = field(default_factory=deque[tuple[int, str]])
    open: str = ""

    def close(self, number: int) -> None:
        self.pieces.append((number, self.open))
        self.open = ""


class Listener(Protocol):
    """Who wants to see, besides, what the reference reads: every packet first, then every record."""

    def packet(self, packet: Packet) -> None:
        """Take a packet."""
        ...

    def record(self, record: Decoded) -> None:
        """Take a record."""
        ...


def _incomparable(tshark: Tshark, carriers: Carriers) -> frozenset[str]:
    """Name the TCP connections for which no setting of Wireshark shows what came when (docs/wires.md, 4).

    Where bytes are lost, in whichever connection, it can't put segments in order; and from 4.2 on it then shows a frame
    in pieces late when a piece of it comes again (seen in 4.4; 4.0 does not).
    """
    if not carriers.lost:
        return frozenset()
    return frozenset(carriers.late if tshark.version.startswith("4.0.") else carriers.late | carriers.again)


def compare(
    tshark: Tshark,
    path: Path,
    *,
    options: Options | None = None,
    wires: Choice | None = None,
    progress: Callable[[int], None] | None = None,
    listener: Listener | None = None,
) -> Comparison:
    """Compare both readings of a capture file.

    options: the constants for both. wires: what the file does not say of its wires. progress: called now and then
    with the number of packets compared. listener: is given all packets of the file, then all records of the reference.
    Raises Problem when the file cannot be read at all, or has no packet of a link type of ours. A file that is cut off
    is compared as far as it goes: ``broken``.
    """
    _refuse_pipes(path)
    result = Comparison()
    wires = wires or Choice()
    carriers = Carriers(wires)
    pieces = _Pieces()
    serial = DALY_LINK_TYPES.intersection(_link_types(path, carriers, result, listener, pieces))
    left_out = _incomparable(tshark, carriers) | pieces.cut_off
    result.left_out = carriers.left_out
    if left_out:
        result.left_out.append(LeftOut("tcp_connections", len(left_out)))
    options = options or Options()
    # Where bytes are lost for good, Wireshark shows nothing behind them while it waits to put segments in order.
    in_order = "FALSE" if carriers.lost else "TRUE"
    arguments = [*preferences(options), *choice.preferences(wires), "-o", f"tcp.reassemble_out_of_order:{in_order}"]
    if serial:
        arguments += ["-o", f"daly.link_types:{','.join(map(str, sorted(serial)))}"]
    arguments += [
        "-r",
        str(tshark.readable(path)),
        "-T",
        "fields",
    ]
    arguments += ["-E", "separator=/t", "-E", f"aggregator={_BETWEEN_VALUES}", "-E", "quote=n"]
    for name in ("frame.number", *FIELD_NAMES, _LUA_ERROR, _EXPERT):
        arguments += ["-e", name]
    # With a filter the first of two passes makes a tree, without which Lua can't tell a packet's interface.
    with _rows(tshark, ["-2", "-Y", "frame", *arguments], result) as rows:
        _walk(rows, _Fed(path, _Told(options, listener), wires, left_out), result, progress)
    told = any(difference.field == _LUA_ERROR for difference in result.differences)
    with _rows(tshark, ["-Y", _LUA_ERROR, *arguments], result) as rows:
        for row in rows:
            values = _values(row)
            if not told:
                result.add(Difference(int(values[0]), _LUA_ERROR, values[-1], "none"))
    return result


def read_alone(
    path: Path,
    *,
    options: Options | None = None,
    wires: Choice | None = None,
    progress: Callable[[int], None] | None = None,
    listener: Listener,
) -> Comparison:
    """Read a capture with the reference decoder alone, where there is no tshark. Arguments and errors as `compare`."""
    _refuse_pipes(path)
    result = Comparison()
    _link_types(path, Carriers(wires), result, listener)
    decoder, carriers = _Told(options or Options(), listener), Carriers(wires)
    for packet in _packets(path):
        if _is_ours(carriers, packet):
            result.packets += 1
            for carrier in carriers.of(packet):
                _count(decoder.feed(carrier), result)
        if progress and packet.number % 4096 == 0:
            progress(packet.number)
    for carrier in carriers.finish():
        _count(decoder.feed(carrier), result)
    _count(decoder.finish(), result)
    result.left_out = carriers.left_out
    return result


def _count(records: list[Decoded], result: Comparison) -> None:
    result.records += len(records)
    for record in records:
        result.kinds[record.kind] = result.kinds.get(record.kind, 0) + 1


class _Told:
    """The reference decoder, its records told to a listener too."""

    def __init__(self, options: Options, listener: Listener | None) -> None:
        self._decoder = Decoder(options)
        self._listener = listener

    def feed(self, packet: Packet) -> list[Decoded]:
        """Take the next packet; return the records that are final."""
        return self._tell(self._decoder.feed(packet))

    def finish(self) -> list[Decoded]:
        """Take the end of the file; return all that was held."""
        return self._tell(self._decoder.finish())

    def _tell(self, records: list[Decoded]) -> list[Decoded]:
        if self._listener is not None:
            for record in records:
                self._listener.record(record)
        return records


def _refuse_pipes(path: Path) -> None:
    if str(path) == "-" or path.is_fifo() or path.is_socket():
        raise Problem(f"{path} can be read only once, and two readers need it; save it in a file first")


@contextlib.contextmanager
def _rows(tshark: Tshark, arguments: list[str], result: Comparison) -> Generator[IO[bytes]]:
    """Give tshark's output, line by line; what it says of itself goes to the result."""
    process = tshark.start(arguments, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout is not None  # noqa: S101 - asked for above
    assert process.stderr is not None  # noqa: S101 - asked for above
    messages: list[bytes] = []
    reader = threading.Thread(target=_drain, args=(process.stderr, messages), daemon=True)
    reader.start()
    try:
        yield process.stdout
    except BaseException:
        process.kill()
        raise
    finally:
        process.stdout.close()
        process.wait()
        reader.join()
        process.stderr.close()
    said = b"".join(messages).decode(errors="replace")
    complaint = lua_complaint(said)
    if complaint and not any(difference.dissector == complaint for difference in result.differences):
        result.add(Difference(0, _LUA_ERROR, complaint, "none"))
    if process.returncode and not result.broken:
        last = said.strip().splitlines()[-1:] or ["it said nothing"]
        result.broken = f"tshark ended with status {process.returncode}: {last[0]}"


def _values(row: bytes) -> list[str]:
    """Return the values of a row; the last one is free text."""
    return row.decode("utf-8", errors="replace").rstrip("\r\n").split(_BETWEEN_FIELDS, _COLUMNS - 1)


def _drain(stream: IO[bytes], into: list[bytes]) -> None:
    kept = 0
    while chunk := stream.read(65536):
        if kept < 1 << 20:
            into.append(chunk)
            kept += len(chunk)


class _Pieces:
    """Finds the TCP connections with a frame in pieces one of which the snap length cut off (docs/wires.md, 4).

    Wireshark hands such a segment over by itself, and loses its place in the frame that began before it.
    """

    def __init__(self) -> None:
        self.cut_off: set[str] = set()
        """Connections, by name."""
        self._sides: dict[tuple[str, str], Splitter] = {}
        self._cut: set[int] = set()

    def take(self, given: Sequence[Packet], *, cut: int = 0) -> None:
        """Take what has come of a packet, and of those that waited for it. cut: its number, where it is cut off."""
        if cut:
            self._cut.add(cut)
        for one in given:
            if one.transport != "tcp":
                continue
            side = self._sides.setdefault((one.connection, one.direction), Splitter())
            if one.after_gap:
                side.flush()
            if one.number in self._cut and side.pending:
                self.cut_off.add(one.connection)
            side.feed(one.data, decide=True)
            if not side.begun:
                side.flush()
        if given:  # with it came all that had waited
            self._cut.clear()


def _link_types(
    path: Path, carriers: Carriers, result: Comparison, listener: Listener | None, pieces: _Pieces | None = None
) -> set[int]:
    """Return the link types of ours in the file, looking at all of it, and whether it reads to its end."""
    ours: set[int] = set()
    others: set[int] = set()
    packets = 0
    try:
        for packet in read_capture(path):
            packets += 1
            if _is_ours(carriers, packet):
                ours.add(packet.link_type)
                given = carriers.of(packet)
                if pieces is not None:
                    pieces.take(given, cut=packet.number if carriers.cut else 0)
            else:
                others.add(packet.link_type)
            if listener is not None:
                listener.packet(packet)
    except CaptureError as error:
        if not packets:
            raise Problem(str(error)) from None
        result.broken = str(error)
    rest = carriers.finish()
    if pieces is not None:
        pieces.take(rest)
    if not packets:
        raise Problem(f"{path}: the capture holds no packet")
    if not ours:
        names = ", ".join(link_type_name(number) for number in sorted(others))
        raise Problem(f"{path}: its link type is {names}; {NOT_READ}")
    if carriers.nothing:
        raise Problem(f"{path}: {carriers.nothing}")
    return ours


def _is_ours(carriers: Carriers, packet: Packet) -> bool:
    return carriers.reads(packet.link_type) and packet.link_type != TAKEN_LINK_TYPE


def _packets(path: Path) -> Iterator[Packet]:
    try:
        yield from read_capture(path)
    except CaptureError:
        return  # said before, by _link_types


class _Fed:
    """The reference's reading of a file, which goes on as far as it is asked to."""

    def __init__(self, path: Path, decoder: _Told, wires: Choice, left_out: frozenset[str]) -> None:
        self.ready: deque[Decoded] = deque()
        self.streams: dict[int, Key] = {}
        """Of packets with something for the decoder, not yet compared: the stream it went to."""
        self.expected: deque[int] = deque()
        """Packets that tshark has to show."""
        self.passed_over: set[int] = set()
        """Packets of connections that are not compared."""
        self.cut: set[int] = set()
        """TCP packets that the snap length cut bytes off."""
        self._packets = _packets(path)
        self._carriers = Carriers(wires)
        self._left_out = left_out
        self._decoder = decoder
        self._ended = False

    def until(self, number: int) -> None:
        """Go on until all records of a packet are final."""
        while not self._ended and not (self.ready and self.ready[-1].number > number):
            self._next()

    def rest(self) -> None:
        """Go on to the end."""
        while not self._ended:
            self._next()

    def _next(self) -> None:
        packet = next(self._packets, None)
        if packet is None:
            self._ended = True
            self._feed(self._carriers.finish())
            self.ready.extend(self._decoder.finish())
        elif _is_ours(self._carriers, packet):
            self.expected.append(packet.number)
            carriers = self._carriers.of(packet)
            if self._carriers.connection in self._left_out:
                self.passed_over.add(packet.number)
            if self._carriers.cut:
                self.cut.add(packet.number)
            self._feed(carriers)

    def _feed(self, carriers: Iterable[Packet]) -> None:
        for carrier in carriers:
            connection = getattr(carrier, "connection", "")
            self.streams[carrier.number] = (connection or carrier.interface, carrier.direction)
            self.ready.extend(self._decoder.feed(carrier))


def _walk(rows: IO[bytes], fed: _Fed, result: Comparison, progress: Callable[[int], None] | None) -> None:
    """Go through both readings together, packet by packet."""
    ready, expected = fed.ready, fed.expected
    sides: dict[Key, tuple[_Rest, _Rest]] = {}
    last_seen = held = 0
    for row in rows:
        values = _values(row)
        number = int(values[0])
        fed.until(number)
        mine: list[Decoded] = []
        while ready and ready[0].number <= number:
            record = ready.popleft()
            if not record.held:
                mine.append(record)
            elif number not in fed.passed_over:  # what TCP holds to the end, Wireshark shows as a TCP segment
                held += 1
        result.packets += 1
        result.records += len(mine)
        while expected and expected[0] <= number:
            if expected[0] < number:
                result.add(Difference(expected[0], "packet", "not shown", "present"))
            expected.popleft()
        if number in fed.passed_over:
            fed.passed_over.discard(number)
            fed.streams.pop(number, None)
            continue
        key = fed.streams.pop(number, None)
        rest = (_Rest(), _Rest()) if key is None else sides.setdefault(key, (_Rest(), _Rest()))
        # The dissector shows the beginning of a frame that is cut off in the packet itself, as no more of it can come.
        open_end = number in fed.cut
        fed.cut.discard(number)
        _packet(number, values[1:], mine, rest, result, open_end=open_end)
        if key is None:  # a packet that is not ours has no record in either reading
            _close(number, rest, result)
        last_seen = number
        if progress and number % 4096 == 0:
            progress(number)
    fed.rest()
    if ready:
        result.add(
            Difference(ready[0].number, "packet", f"nothing after packet {last_seen}", f"{len(ready)} more records")
        )
    for rest in sides.values():
        _close(last_seen, rest, result)
    if held:
        result.left_out.append(LeftOut("tcp_records", held))


def _close(number: int, rest: tuple[_Rest, _Rest], result: Comparison) -> None:
    """Compare what is left of a stream that has ended."""
    dissector, reference = rest
    dissector.close(number)
    reference.close(number)
    _compare_rest(dissector, reference, result)
    if len(dissector.pieces) != len(reference.pieces) and not result.found:  # else its cause is named
        shown, told = (f"{len(side.pieces)} more stretches of bytes" for side in rest)
        result.add(Difference(number, "bytes before", shown, told))


def _packet(
    number: int,
    values: list[str],
    mine: list[Decoded],
    rest: tuple[_Rest, _Rest],
    result: Comparison,
    *,
    open_end: bool = False,
) -> None:
    """Compare all records that end in one packet; open_end: but for cut-off frames and junk behind the others."""
    *values, lua_error, expert = values
    if lua_error:
        result.add(Difference(number, _LUA_ERROR, expert, "none"))
    seen = [value.split(_BETWEEN_VALUES) if value else [] for value in values]
    opened = tuple(len(side.open) for side in rest)
    pieces = tuple(len(side.pieces) for side in rest)
    _set_aside(number, seen, rest[0])
    told: dict[str, list[object]] = {}
    for record in mine:
        result.kinds[record.kind] = result.kinds.get(record.kind, 0) + 1
        if record.kind in _REST_KINDS:
            rest[1].open += record.data.hex()
            continue
        if record.kind != "event":
            rest[1].close(number)
        for name, value in record.fields.items():
            told.setdefault(name, []).extend(value if isinstance(value, list) else [value])
    if open_end:
        for side, length, count in zip(rest, opened, pieces, strict=True):
            side.open = side.open[:length] if len(side.pieces) == count else ""
    _compare_rest(*rest, result)
    if any(len(side.open) > _MOST_REST for side in rest):
        _compare_open(number, rest, result)
    for name in told.keys() - _KNOWN:
        result.add(Difference(number, name, "not a field of the dissector", str(told[name])))
    for name, values_seen in zip(FIELD_NAMES, seen, strict=True):
        expected = told.get(name)
        if expected is None:
            if not values_seen:
                continue  # nearly all of some hundred fields
            expected = []
        if len(values_seen) != len(expected) or not all(
            _same(name, one, other) for one, other in zip(values_seen, expected, strict=True)
        ):
            result.add(
                Difference(
                    number,
                    name,
                    ", ".join(values_seen) or "absent",
                    ", ".join(map(_shown, expected)) or "absent",
                )
            )


_KNOWN = frozenset(FIELD_NAMES)


def _set_aside(number: int, seen: list[list[str]], rest: _Rest) -> None:
    """Take cut-off frames and junk out of the dissector's row, into ``rest``."""
    kinds, undecoded = seen[_KIND], deque(seen[_UNDECODED])
    kept: list[str] = []
    kept_undecoded: list[str] = []
    for kind in kinds:
        if kind in _REST_KINDS:
            rest.open += undecoded.popleft().replace(":", "") if undecoded else ""
            continue
        kept.append(kind)
        if kind != "event":
            rest.close(number)
        if kind == "foreign" and undecoded:
            kept_undecoded.append(undecoded.popleft())
    seen[_TRANSPORT] = seen[_TRANSPORT][: len(kept)] if len(kept) < len(kinds) else seen[_TRANSPORT]
    seen[_KIND], seen[_UNDECODED] = kept, kept_undecoded + list(undecoded)


def _compare_rest(dissector: _Rest, reference: _Rest, result: Comparison) -> None:
    while dissector.pieces and reference.pieces:
        number, theirs = dissector.pieces.popleft()
        _, ours = reference.pieces.popleft()
        if theirs != ours:
            result.add(Difference(number, "bytes before", theirs or "none", ours or "none"))


def _compare_open(number: int, rest: tuple[_Rest, _Rest], result: Comparison) -> None:
    """Compare what both have of a long stretch of junk, so that it need not be kept."""
    dissector, reference = rest
    both = min(len(dissector.open), len(reference.open))
    if dissector.open[:both] != reference.open[:both]:
        result.add(Difference(number, "bytes before", "differ", "differ"))
    dissector.open, reference.open = dissector.open[both:], reference.open[both:]


def _shown(value: object) -> str:
    return str(int(value)) if isinstance(value, bool) else str(value)


def _same(name: str, seen: str, told: object) -> bool:
    """Tell whether tshark's text means the reference's value. Booleans print as 1 or True, by version."""
    if isinstance(told, bool):
        return seen in (("1", "True") if told else ("0", "False"))
    if isinstance(told, int):
        try:
            return int(seen, 0) == told
        except ValueError:
            return False
    if isinstance(told, float):
        try:
            value = float(seen)
        except ValueError:
            return False
        if name in _TIMES:
            return abs(value - told) <= _TIME_TOLERANCE_S
        return math.isclose(value, told, rel_tol=1e-12, abs_tol=1e-12)
    if name in _BYTES:
        return seen.replace(":", "") == told
    return told in (seen, seen.replace("\\\\", "\\"))  # from 4.2 on tshark doubles a backslash


_BYTES = frozenset({"daly.data", "daly.reserved", "daly.undecoded"})
