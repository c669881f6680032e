# SPDX-License-Identifier: GPL-2.0-or-later
"""The samples of CAN, Bluetooth and TCP: rebuilt byte for byte, what was put in, and the same in both readings."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import TypedDict

import pytest

from dalycapture.reader import read_capture
from dalyref.decoder import Decoder
from dalytools.cli import main
from dalytools.wires.carriers import Carriers
from dalytools.wires.choice import Choice, numbers

FOLDER = Path(__file__).parents[2] / "pcap_samples" / "wires"


class Entry(TypedDict):
    """A sample in the manifest."""

    file: str
    look: str
    origin: str
    counts: dict[str, int]
    tcp_ports: str


MANIFEST: list[Entry] = json.loads((FOLDER / "manifest.json").read_text(encoding="utf-8"))


def test_rebuilt_byte_for_byte_and_nothing_else_lies_there(tmp_path: Path) -> None:
    script = FOLDER.parent / "make_wire_samples.py"
    subprocess.run([sys.executable, script, tmp_path], check=True, timeout=60)
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert made == {path.name: path.read_bytes() for path in FOLDER.iterdir()}
    assert set(made) == {*(entry["file"] for entry in MANIFEST), "manifest.json", "README.md"}


@pytest.mark.parametrize("entry", MANIFEST, ids=[entry["file"] for entry in MANIFEST])
def test_counts_are_what_was_put_in(entry: Entry) -> None:
    """The manifest's hand-counted records against the reference decoder."""
    decoder, carriers = Decoder(), Carriers(Choice(tcp_ports=numbers(entry["tcp_ports"])))
    given = [one for packet in read_capture(FOLDER / entry["file"]) for one in carriers.of(packet)]
    records = [record for one in (*given, *carriers.finish()) for record in decoder.feed(one)]
    records += decoder.finish()
    assert Counter(str(record.kind) for record in records) == entry["counts"]


def test_the_wires_are_those_that_they_are_named_for() -> None:
    """SocketCAN 227, HCI with direction 201, Ethernet 1, USER0 147."""
    types = {
        name: {packet.link_type for packet in read_capture(FOLDER / f"{name}.pcapng")}
        for name in ("real-can", "made-can", "made-ble", "made-tcp", "made-all-wires")
    }
    assert types == {
        "real-can": {227},
        "made-can": {227},
        "made-ble": {201},
        "made-tcp": {1},
        "made-all-wires": {147, 227, 201, 1},
    }


def test_real_bytes_are_real() -> None:
    rows = map(json.loads, (FOLDER.parent / "real-frames.jsonl").read_text(encoding="utf-8").splitlines())
    real = [bytes.fromhex(row["hex"]) for row in rows if row["id"].startswith("can212-")]
    assert [packet.data[8:] for packet in read_capture(FOLDER / "real-can.pcapng")] == real


def test_both_readings_say_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    paths = [str(FOLDER / entry["file"]) for entry in MANIFEST]
    assert main(["check", "--tcp-ports", "8899", *paths]) == 0
    assert "5 files, 268 records" in capsys.readouterr().out  # 18 + 3 x 50 + 100
