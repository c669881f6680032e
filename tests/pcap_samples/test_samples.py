# SPDX-License-Identifier: GPL-2.0-or-later
"""The samples: rebuilt byte for byte, and holding what their manifest says was put in."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

import pytest

from dalycapture.reader import read_capture
from dalyref.decoder import decode

if TYPE_CHECKING:
    from dalyref.packet import Packet

FOLDER = Path(__file__).parents[2] / "pcap_samples"


class Entry(TypedDict):
    """A sample in the manifest."""

    file: str
    real: bool
    origin: list[str]
    note: str
    look: str
    link_type: int
    counts: dict[str, int]


MANIFEST: list[Entry] = json.loads((FOLDER / "manifest.json").read_text(encoding="utf-8"))
REAL: dict[str, dict[str, str]] = {
    entry["id"]: entry
    for entry in map(json.loads, (FOLDER / "real-frames.jsonl").read_text(encoding="utf-8").splitlines())
}
each = pytest.mark.parametrize("entry", MANIFEST, ids=[entry["file"] for entry in MANIFEST])


def packets(entry: Entry) -> list[Packet]:
    return list(read_capture(FOLDER / entry["file"]))


def test_rebuilt_byte_for_byte(tmp_path: Path) -> None:
    """Also on a machine that has never seen them, and twice over."""
    for attempt in ("one", "two"):
        folder = tmp_path / attempt
        folder.mkdir()
        subprocess.run([sys.executable, FOLDER / "make_samples.py", folder], check=True, timeout=60)
        made = sorted(path.name for path in folder.iterdir())
        assert made == sorted([*(entry["file"] for entry in MANIFEST), "manifest.json", "README.md"])
        for name in made:
            assert (folder / name).read_bytes() == (FOLDER / name).read_bytes(), name


def test_nothing_else_lies_there_and_it_is_small() -> None:
    captures = {path.name for path in FOLDER.iterdir() if path.suffix in {".pcap", ".pcapng"}}
    assert captures == {entry["file"] for entry in MANIFEST}
    assert sum(path.stat().st_size for path in FOLDER.iterdir() if path.is_file()) < 1_000_000


@each
def test_counts_are_what_was_put_in(entry: Entry) -> None:
    """The manifest's hand-counted records against the reference decoder."""
    kinds = Counter(str(record.kind) for record in decode(packets(entry)))
    assert dict(kinds) == entry["counts"]


@each
def test_link_type_description_and_origin(entry: Entry) -> None:
    seen = packets(entry)
    assert {packet.link_type for packet in seen} == {entry["link_type"]}
    if entry["file"].endswith(".pcapng"):
        assert {packet.description for packet in seen} == {"dalyshark bus=main 9600 8N1 sample"}
        assert seen[0].comment == entry["note"]
    times = [packet.time_ns for packet in seen]
    assert times == sorted(times)
    assert entry["real"] == entry["file"].startswith("real-")


@each
def test_real_bytes_are_real_and_whole(entry: Entry) -> None:
    """A sample with an origin is its origin's bytes in order, to the last one; none that somebody made up."""
    if entry["origin"] == ["simulated bus"]:
        assert not entry["real"]
        return
    ids = list(entry["origin"])
    if "doc-wr-req" in ids:
        ids.insert(ids.index("doc-wr-req"), "doc-wr-req")  # a write of one register and its reply are the same bytes
    whole = b"".join(bytes.fromhex(REAL[name]["hex"]) for name in ids)
    assert b"".join(packet.data for packet in packets(entry)) == whole
    assert not any("synthetic" in REAL[name] for name in ids)
    if entry["real"]:
        assert not any("rebuilt_envelope" in REAL[name] for name in ids)


def test_every_real_serial_frame_is_in_a_sample() -> None:
    used = {name for entry in MANIFEST for name in entry["origin"]}
    serial = {name for name, entry in REAL.items() if entry["transport"] == "uart"}
    in_another = {"tano-95-seq", "lv165-95-1", "lv165-95-2", "lv165-95-3", "lv165-95-4", "lv165-mix"}
    assert serial - used == in_another


def test_chunked_sample_is_cut_as_promised() -> None:
    """Parts of frames, and several frames, in a packet: but the bytes of the poll that it was cut from."""
    chunked = list(read_capture(FOLDER / "made-raw-chunked.pcapng"))
    clean = list(read_capture(FOLDER / "made-poll-cycle.pcapng"))
    sizes = [len(packet.data) for packet in chunked]
    assert min(sizes) < 5
    assert max(sizes) > 26
    stream = b"".join(packet.data for packet in chunked)
    assert len(stream) == 650
    assert b"".join(packet.data for packet in clean).startswith(stream)


@each
def test_tshark_reads_every_packet(entry: Entry) -> None:
    """Wireshark's own view of the bytes, without our dissector."""
    words = ["tshark", "-r", str(FOLDER / entry["file"]), "-T", "fields", "-e", "frame.number", "-e", "frame.len"]
    out = subprocess.run(words, capture_output=True, text=True, check=True, timeout=60).stdout
    expected = [f"{packet.number}\t{len(packet.data)}" for packet in packets(entry)]
    assert out.split() == "\n".join(expected).split()
