# SPDX-License-Identifier: GPL-2.0-or-later
"""A burst whose frame 0 was damaged, of a board that counts from 0 (docs/records.md 8, the base); worked out by hand.

Eight cells in three frames, told by 0x94: with base 0 number 1 is cells 4 to 6, and number 2 cells 7 and 8 and a slot
that is none; with base 1 they are cells 1 to 3 and 4 to 6. So the base shows in how many cells number 2 has.
"""

from __future__ import annotations

import random
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import pytest
from tests.dissector.dissection import Dissect, P, Row, a5, info, kinds, number, numbers
from tests.dissector.hci_frames import Radio
from tests.dissector.test_bursts import cells, sensors, status
from tests.dissector.test_doors import PORTS, Connection, ask
from tests.dissector.test_views import Sharkd

from dalycapture.create import open_writer
from dalycapture.interface import Interface

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from dalytools.tshark import Tshark

EIGHT = status(8, 1)
ZERO, ONE, TWO = cells(0, 3301, 3302, 3303), cells(1, 3304, 3305, 3306), cells(2, 3307, 3308)
FOREIGN = "010300000002c40b"  # another maker's Modbus RTU

BAD_SUM = ZERO[:-2] + ("00" if ZERO[-2:] != "00" else "01")
DAMAGE = {"bad_checksum": BAD_SUM, "short": ZERO[:18], "junk": "0ce5"}

PASSES: dict[str, dict[str, bool]] = {"one": {"two_pass": False}, "two": {"tree": False}, "two with a tree": {}}


def spread(*frames: str, step: float = 0.05) -> list[P]:
    return [P(frame, step * place) for place, frame in enumerate(frames)]


def base(one: Row, two: Row) -> int:
    """The base that these two frames of a burst, numbers 1 and 2, are shown with; all that tells it must agree."""
    assert numbers(one, "frame_number") + numbers(two, "frame_number") == [1, 2]
    missing, first, last = numbers(one, "burst.missing"), numbers(one, "cell.voltage"), numbers(two, "cell.voltage")
    assert numbers(two, "burst.missing") == []
    assert "daly.cells.voltage" not in one
    assert "daly.cells.voltage" not in two
    assert first == [3304, 3305, 3306]
    if missing == [0]:
        assert last == [3307, 3308]
        assert "cells 4-6" in info(one)
        assert "cells 7-8" in info(two)
        return 0
    assert missing == []
    assert last == [3307, 3308, 0]
    assert "cells 1-3" in info(one)
    assert "cells 4-6" in info(two)
    return 1


def on_sides(heard: tuple[int, int], damaged: tuple[int, int], spoken: tuple[int, int]) -> list[P]:
    """Return a burst behind damage; interface and direction of number 0, of the damage, and of the burst."""
    return [
        P(EIGHT, 0, *heard),
        P(ZERO, 0.05, *heard),
        P(a5(2, 0x91), 0.10, 0, 1),
        P(a5(2, 0x91), 0.15, 0, 2),
        P(a5(2, 0x91), 0.20, 1),
        P(BAD_SUM, 0.25, *damaged),
        P(ONE, 0.30, *spoken),
        P(TWO, 0.35, *spoken),
    ]


BURST = [ONE, TWO]
AGAIN = [EIGHT, ZERO, ONE, TWO]  # a whole burst from 0, before

CASES: dict[str, tuple[list[P], int]] = {
    # name: (packets, on interface 0 or 1 of a bus of their own; base of the last two)
    **{kind: (spread(*AGAIN, damage + ONE, TWO), 0) for kind, damage in DAMAGE.items()},
    # No number 0 before.
    "nothing before": (spread(EIGHT, BAD_SUM, *BURST), 1),
    "bursts from 1": (spread(EIGHT, ONE, TWO, BAD_SUM, *BURST), 1),
    "another board's 0": (spread(EIGHT, cells(0, 3301, address=2), BAD_SUM, *BURST), 1),
    "another ID's 0": (spread(EIGHT, sensors(0, 20), BAD_SUM, *BURST), 1),
    "a damaged 0": (spread(EIGHT, BAD_SUM, a5(1, 0x91), BAD_SUM, *BURST), 1),
    # No damage right before. Foreign bytes right behind damage would be one gap with it, and so junk.
    "nothing between": (spread(*AGAIN, *BURST), 1),
    "foreign": (spread(*AGAIN, FOREIGN, *BURST), 1),
    "damage, foreign": (spread(*AGAIN, BAD_SUM, "", FOREIGN, *BURST), 1),
    "damage, the Bluetooth module's": (spread(*AGAIN, "0ce5" + "81100f05000200000000876a", *BURST), 1),
    "damage, a reply": (spread(*AGAIN, BAD_SUM, a5(1, 0x91), *BURST), 1),
    "damage, a request": (spread(*AGAIN, BAD_SUM, a5(0x40, 0x95), *BURST), 1),
    "damage, a skipped frame": (spread(*AGAIN, BAD_SUM, cells(0xFF, 1, 2, 3), *BURST), 1),
    "damage, Modbus": (spread(*AGAIN, BAD_SUM, "d203000c000157aa", *BURST), 1),
    "damage within the burst": (spread(*AGAIN, a5(1, 0x91), ONE, "0ce5" + TWO), 1),
    # Events and time are nothing.
    "an event": (spread(*AGAIN, "0ce5", "", *BURST), 0),
    "two events": (spread(*AGAIN, BAD_SUM, "", "", *BURST), 0),
    "an hour": ([*spread(*AGAIN, "0ce5"), P(ONE, 3600), P(TWO, 3600.05)], 0),
    "an hour and an event": ([*spread(*AGAIN, "0ce5", ""), P(ONE, 3600), P(TWO, 3600.05)], 0),
    # Number 0 was heard anywhere on the bus; damage is looked for on the burst's own interface and side.
    "two interfaces": (on_sides((0, 0), (1, 0), (1, 0)), 0),
    "damage on the other interface": (on_sides((0, 0), (0, 0), (1, 0)), 1),
    "inbound": (on_sides((0, 1), (0, 1), (0, 1)), 0),
    "0 outbound": (on_sides((0, 2), (0, 1), (0, 1)), 0),
    "damage outbound": (on_sides((0, 1), (0, 2), (0, 1)), 1),
}

Seen = dict[str, list[Row]]


def each_on_a_bus(dissect: Dissect, cases: Mapping[str, Sequence[P]], **how: Any) -> Seen:
    """Dissect all in one capture, one behind the other, each on two interfaces of its own."""
    packets: list[P] = []
    for index, case in enumerate(cases.values()):
        packets += [replace(p, at=p.at + 10000 * index, interface=p.interface + 2 * index) for p in case]
    descriptions = [f"dalyshark bus={index // 2}" for index in range(2 * len(cases))]
    rows = dissect(packets, descriptions=descriptions, **how)
    seen: Seen = {}
    for name, case in cases.items():
        seen[name] = rows[: len(case)]
        del rows[: len(case)]
    return seen


@pytest.fixture(scope="module", params=PASSES)
def seen(request: pytest.FixtureRequest, dissect: Dissect) -> Seen:
    how = PASSES[cast("str", request.param)]
    return each_on_a_bus(dissect, {name: packets for name, (packets, _) in CASES.items()}, **how)


@pytest.mark.parametrize("name", CASES)
def test_the_base(seen: Seen, name: str) -> None:
    one, two = seen[name][-2:]
    assert base(one, two) == CASES[name][1]
    if name in DAMAGE:
        assert kinds([one]) == [f"{name}+frame"]
        assert numbers(seen[name][3], "cells.voltage") == list(range(3301, 3309))


@pytest.mark.parametrize("passes", PASSES)
def test_a_line_of_its_own(dissect: Dissect, passes: str) -> None:
    """Where a first pass makes no tree, a second one reads several lines again; one line it does not."""
    rows = dissect(spread(*AGAIN, BAD_SUM, *BURST, a5(1, 0x91), "0ce5" + ZERO, *BURST), **PASSES[passes])
    assert base(rows[5], rows[6]) == 0
    assert numbers(rows[10], "cells.voltage") == list(range(3301, 3309))


CUT = {f"{kind}, {size}": (damage, size) for kind, damage in DAMAGE.items() for size in (1, 5, 12, 13, 14, 31, 200)}


@pytest.fixture(scope="module", params=[False, True], ids=["one", "two"])
def cut(request: pytest.FixtureRequest, dissect: Dissect) -> Seen:
    cases: dict[str, list[P]] = {}
    for name, (damage, size) in CUT.items():
        stream = "77" + "".join([*AGAIN, damage, *BURST, *BURST])
        pieces = [stream[at : at + 2 * size] for at in range(0, len(stream), 2 * size)]
        cases[name] = [P(piece, place * size * 10 / 9600) for place, piece in enumerate(pieces)]
    return each_on_a_bus(dissect, cases, two_pass=cast("bool", request.param))


@pytest.mark.parametrize("name", CUT)
def test_packets_may_be_cut_anywhere(cut: Seen, name: str) -> None:
    assert [value for row in cut[name] for value in numbers(row, "burst.missing")] == [0]
    first, again, from_one = [*range(3301, 3309)], [*range(3304, 3309)], [*range(3304, 3309), 0]
    assert [value for row in cut[name] for value in numbers(row, "cell.voltage")] == first + again + from_one


def test_sensors_and_texts_too(dissect: Dissect) -> None:
    hot = [sensors(0, *range(1, 8)), sensors(1, 8, 9)]
    text = [a5(1, 0x62, f"{place:02x}" + "41" * 7) for place in (0, 1)]
    between = a5(1, 0x91)
    frames = [status(8, 8), hot[0], between, BAD_SUM, hot[1], text[0], between, "0ce5" + text[1], between]
    rows = dissect(spread(*frames))
    assert numbers(rows[4], "burst.missing") == numbers(rows[7], "burst.missing") == [0]
    assert numbers(rows[4], "temperature") == [8]
    assert "daly.sensors.temperature" not in rows[4]
    assert rows[5]["daly.software_version"] == ["AAAAAAA"]
    assert "daly.software_version" not in rows[7]


@pytest.mark.parametrize(
    ("of", "highest", "shown", "other"),
    [(cells, 16, "cell.voltage", sensors), (sensors, 3, "temperature", cells)],
    ids=["0x95", "0x96"],
)
def test_a_number_that_base_zero_has_not_is_skipped(
    dissect: Dissect, of: Callable[..., str], highest: int, shown: str, other: Callable[..., str]
) -> None:
    zero, last = of(0, 20), of(highest, 20)
    cases = {
        "behind damage": spread(zero, other(0, 20), BAD_SUM, last, other(1, 20)),
        "behind none": spread(zero, a5(1, 0x91), last),
    }
    seen = each_on_a_bus(dissect, cases)
    *_, skipped, after = seen["behind damage"]
    assert f"daly.{shown}" not in skipped
    assert numbers(skipped, "burst.missing") == []
    assert numbers(after, "burst.missing") == []  # the running burst, of the other ID, goes on
    assert numbers(seen["behind none"][-1], "burst.missing") == list(range(1, highest))
    assert f"daly.{shown}" in seen["behind none"][-1]


def test_a_frame_that_waits_for_its_neighbour(dissect: Dissect) -> None:
    """Its cells hold the beginning of another frame, A5 . . 08, which the next packet takes away."""
    waits = cells(1, 0x0CA5, 0x0CE4, 0x0808)
    rows = dissect(spread(EIGHT, ZERO, a5(1, 0x91), "0ce5" + waits, TWO), two_pass=False)
    assert numbers(rows[3], "burst.missing") == [0]
    assert numbers(rows[4], "cell.voltage") == [3307, 3308]


def taken_back(address: int) -> list[P]:
    """What one line holds turns out otherwise when the other has told of number 1 behind damage.

    W  A5 40 90 08 00 00 A5 address 91 08 00 00 sum       good, and holds the beginning of V: it waits
    V                    A5 address 91 08 00 00 sum 00 .. good, and nothing good begins where W ends: W was none
    """
    w = bytes.fromhex(f"a54090080000a5{address:02x}91080000")
    w += bytes((sum(w) & 0xFF,))
    v = w[6:] + bytes(5)
    v += bytes((sum(v) & 0xFF,))
    return [
        P(EIGHT, 0, 1),
        P(ZERO, 0.02, 1),
        P(a5(1, 0x91), 0.05, 1),
        P("0ce5", 0.08, 1),
        P(w.hex(), 0.10, 0),
        P(ONE, 0.104, 1),
        P(v[7:].hex(), 0.114, 0),
        P(TWO, 0.12, 1),
    ]


@pytest.mark.parametrize("passes", PASSES)
def test_what_the_bus_is_told_again(dissect: Dissect, passes: str) -> None:
    """In the order of the packets: where V is a reply, it ends the burst behind number 1, not before it."""
    seen = each_on_a_bus(dissect, {"request": taken_back(0x40), "reply": taken_back(0x01)}, **PASSES[passes])
    assert [numbers(rows[6], "data_id") for rows in seen.values()] == [[0x91], [0x91]]
    assert base(seen["request"][5], seen["request"][7]) == 0
    assert [numbers(row, "burst.missing") for row in seen["reply"][5:]] == [[0], [], [1]]


def save(path: Path, packets: Sequence[P], descriptions: Sequence[str]) -> Path:
    with open_writer(path) as writer:
        for description in descriptions:
            writer.add_interface(Interface("made", description, 147))
        for packet in packets:
            writer.write_packet(
                1_700_000_000_000_000_000 + round(packet.at * 1e9),
                bytes.fromhex(packet.hex),
                interface=packet.interface,
                flags=packet.direction,
            )
    path.chmod(0o644)
    return path


def test_any_order_shows_the_same(tshark: Tshark, open_folder: Path) -> None:
    packets: list[P] = []
    for side in 0, 1:
        at = 0.02 * side
        packets += [
            P(piece, at + 0.1 * place, side)
            for place, piece in enumerate([EIGHT, ZERO, ONE, TWO, BAD_SUM, ONE, TWO, "0ce5" + ONE, TWO])
        ]
    packets.sort(key=lambda packet: packet.at)
    server = Sharkd(tshark, save(open_folder / "two.pcapng", packets, ["dalyshark bus=a", "dalyshark bus=b"]))
    order = list(range(1, len(packets) + 1))
    try:
        for place in order:  # to its end: so it knows both buses
            server.tree(place)
        in_order = {place: str(server.tree(place)) for place in order}
        random.Random(3).shuffle(order)
        for place in order:
            assert str(server.tree(place)) == in_order[place], place
    finally:
        server.close()
    assert [place for place in sorted(order) if "daly.burst.missing" in in_order[place]] == [11, 12, 15, 16]


TOLD = ["daly.frame_number", "daly.burst.missing", "daly.cell.voltage"]


@pytest.mark.parametrize(("passes", "size"), [((), 5), (("-2",), 5), (("-2", "-Y", "frame"), 13), ((), 200)], ids=str)
def test_tcp(tshark: Tshark, open_folder: Path, passes: tuple[str, ...], size: int) -> None:
    connection = Connection(open_folder)
    answer = EIGHT + ZERO + ONE + TWO + BAD_SUM + ONE + TWO
    for start in range(0, len(answer), 2 * size):
        connection.send(0, a5(0x40, 0x95))  # the other direction stands between, and is no matter
        connection.send(1, answer[start : start + 2 * size])
    rows = ask(tshark, connection.save(), *passes, *PORTS, names=TOLD)
    told = [",".join(row[column] for row in rows if row[column]) for column in range(3)]
    assert told == ["0,1,2,1,2", "0", "3301,3302,3303,3304,3305,3306,3307,3308,3304,3305,3306,3307,3308"]


@pytest.mark.parametrize(("side", "expected"), [(1, ""), (0, "0")])
def test_tcp_damage_of_the_other_direction(tshark: Tshark, open_folder: Path, side: int, expected: str) -> None:
    connection = Connection(open_folder)
    connection.send(0, EIGHT + ZERO + a5(1, 0x91))
    connection.send(1, a5(0x40, 0x95))
    connection.send(side, BAD_SUM)
    connection.send(0, ONE)
    rows = ask(tshark, connection.save(), *PORTS, names=TOLD)
    assert rows[-1] == ["1", expected, "3304,3305,3306"]


@pytest.mark.parametrize(("before", "expected"), [(a5(1, 0x91), ""), ("0ce5", "0")], ids=["a frame", "junk"])
def test_tcp_bytes_that_are_held_in_vain_count_not(
    tshark: Tshark, open_folder: Path, before: str, expected: str
) -> None:
    """The first half of number 0 waits for its other half, which is lost."""
    connection = Connection(open_folder)
    connection.send(1, EIGHT + ZERO + a5(1, 0x91))
    connection.send(1, before)
    connection.send(1, ZERO[:12])
    connection.next[1] += 7
    connection.send(1, ONE)
    rows = ask(tshark, connection.save(), *PORTS, names=TOLD)
    assert rows[-1] == ["1", expected, "3304,3305,3306"]


SPOKEN: dict[str, tuple[list[str], int | None]] = {
    # name: (values of the board behind a whole burst; what the last one misses)
    "bad_checksum": ([BAD_SUM, ONE], 0),
    "junk": (["0ce5", ONE], 0),
    "junk, the module's text": (["0ce5", b"+OK".hex(), ONE], None),
    "junk on both sides of it": (["0ce5", b"+OK".hex(), "0ce5", ONE], 0),
    "a frame": ([a5(1, 0x91), ONE], None),
}


@pytest.mark.parametrize("passes", PASSES)
def test_bluetooth(dissect: Dissect, passes: str) -> None:
    made = Radio()
    lasts: list[int] = []
    for connection, (values, _) in enumerate(SPOKEN.values()):
        made.connection = 0x40 + connection
        made.complete()
        made.discover((0x0F, 0xFFF2), (0x11, 0xFFF1))
        for value in (EIGHT, ZERO, a5(1, 0x91), *values):
            made.write(0x0F, a5(0x80, 0x95))
            made.notify(0x11, value)
        lasts.append(len(made.packets) - 1)
    rows = dissect(made.packets, link_type=made.link_type, descriptions=["bluetooth0"], **PASSES[passes])
    expected = {name: missing for name, (_, missing) in SPOKEN.items()}
    assert dict(zip(SPOKEN, (number(rows[last], "burst.missing") for last in lasts), strict=True)) == expected
