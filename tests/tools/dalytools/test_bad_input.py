# SPDX-License-Identifier: GPL-2.0-or-later
"""Every command against every input that it cannot use: one line on standard error, status 2, no traceback.

And fuzz: whatever bytes a capture holds, readers and decoder end in records or in one kind of error.
"""

from __future__ import annotations

import gzip
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import find, given, settings
from hypothesis import strategies as st
from tests.capture.bus import Bus
from tests.tools.dalytools.made import ASK, SAMPLES, write

from dalycapture.errors import CaptureError
from dalycapture.reader import read_capture
from dalyref.decoder import decode
from dalytools.cli import main
from dalytools.tshark import Tshark

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dalyref.packet import Packet

CYCLE = SAMPLES / "real-poll-cycle.pcapng"
WHOLE = CYCLE.read_bytes()
CLASSIC = (SAMPLES / "made-classic.pcap").read_bytes()


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Leave the launcher's proof out: test_tshark.py has it. And let nothing be written beside the sources."""

    def trust(_: Tshark, __: Path) -> None:
        return

    monkeypatch.setattr(Tshark, "_prove", trust)
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def bus() -> Iterator[Bus]:
    with Bus() as one:
        yield one


def file_of(content: bytes) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = folder / "input"
        path.write_bytes(content)
        path.chmod(0o644)
        return path

    return make


def nothing(folder: Path) -> Path:
    return folder / "none"


def itself(folder: Path) -> Path:
    return folder


def named(name: str) -> Callable[[Path], Path | str]:
    return lambda folder: name if name.startswith("/") or ":" in name else folder / name


def ethernet(folder: Path) -> Path:
    return write(folder / "input", [(0.0, bytes(60))], link_type=1)


def no_packet(folder: Path) -> Path:
    return write(folder / "input", [])


CAPTURES: dict[str, tuple[Callable[[Path], Path], str]] = {
    "missing": (nothing, "there is no such file"),
    "a directory": (itself, "is a directory"),
    "empty": (file_of(b""), "is empty; a capture has at least a header"),
    "text": (file_of(b"12:00 A5 40 90\n"), "is a text file, not a capture; dalyshark import makes one of a log"),
    "bytes": (file_of(bytes(range(256))), "is not a capture file; give a pcapng or pcap file"),
    "a magic alone": (file_of(WHOLE[:4]), "cut off in the middle"),
    "a header cut off": (file_of(WHOLE[:40]), "cut off in the middle of a block"),
    "cut off": (file_of(WHOLE[:-70]), "cut off in the middle of a block at byte"),
    "classic, cut off": (file_of(CLASSIC[:-5]), "cut off in the middle of a packet"),
    "damaged": (file_of(WHOLE[:-200] + b"\xff" * 100 + WHOLE[-100:]), "damaged near byte"),
    "compressed, cut off": (file_of(gzip.compress(WHOLE)[:-20]), "cut off in the middle of its compressed data"),
    "wrong link type": (ethernet, "1 (Ethernet)"),
    "without packets": (no_packet, "holds no packet"),
}
FINE = {("decode", "without packets"): 0}
SAYS = {
    ("simulate", "wrong link type"): "holds no bytes of a serial bus (link type USER0 to USER15): nothing to play back",
    ("simulate", "without packets"): "holds no bytes of a serial bus (link type USER0 to USER15): nothing to play back",
}
READERS = {"decode": ["decode"], "check": ["check"], "simulate": ["simulate", "--speed", "1000", "--replay"]}


def one_line(command: str, capsys: pytest.CaptureFixture[str]) -> str:
    """The one line; what a command says to standard output is another matter."""
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 or (len(lines) == 2 and lines[1] == f"Try: dalyshark {command} --help"), lines
    assert lines[0].startswith(f"dalyshark {command}: ")
    return lines[0]


@pytest.mark.parametrize("what", CAPTURES)
@pytest.mark.parametrize("command", READERS)
def test_captures(command: str, what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make, says = CAPTURES[what]
    path = make(tmp_path)
    assert main([*READERS[command], str(path)]) == FINE.get((command, what), 2)
    line = one_line(command, capsys)
    assert SAYS.get((command, what), says) in line
    assert str(path) in line


@pytest.mark.parametrize("command", READERS)
def test_captures_that_may_not_be_read(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = file_of(WHOLE)(tmp_path)
    if os.geteuid():
        path.chmod(0)
    else:  # nothing is closed to root
        opened = Path.open

        def refuse(self: Path, *words: str, **more: str) -> object:
            if self == path:
                raise PermissionError(13, "Permission denied", str(path))
            return opened(self, *words, **more)  # pyright: ignore[reportCallIssue, reportArgumentType, reportUnknownVariableType]

        monkeypatch.setattr(Path, "open", refuse)
    assert main([*READERS[command], str(path)]) == 2
    assert one_line(command, capsys) == f"dalyshark {command}: {path}: no permission to read it"


def words_for(command: str, port: str, output: object) -> list[str]:
    return [command, port, "-w", str(output)]


@pytest.mark.parametrize("command", ["watch", "capture"])
@pytest.mark.parametrize(
    ("make", "says"),
    [
        (nothing, "is not there; "),
        (itself, "is a directory, not a serial device"),
        (file_of(b"text"), "is a file, not a serial device"),
        (named("/dev/null"), "is not a serial "),
        (named("socket://127.0.0.1:1"), "refused"),
        (named("http://example.invalid"), "is "),
    ],
)
def test_ports(
    command: str, make: Callable[[Path], object], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    port = str(make(tmp_path))
    assert main(words_for(command, port, tmp_path / "out.pcapng")) == 2
    line = one_line(command, capsys)
    assert says in line.lower()
    assert port.removeprefix("socket://") in line
    assert not (tmp_path / "out.pcapng").exists()


@pytest.mark.parametrize("command", ["watch", "capture"])
@pytest.mark.parametrize(
    ("make", "says"),
    [
        (itself, "is a directory; give the name of a file in it"),
        (named("none/out"), "there is no directory "),
        (file_of(b"a diary"), "is not a capture file, so it is not overwritten"),
        (named("/dev/full"), "/dev/full: no space left on device; "),
        (named("/proc/out"), "/proc"),
    ],
)
def test_outputs(
    command: str,
    make: Callable[[Path], object],
    says: str,
    bus: Bus,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    output = make(tmp_path)
    assert main(words_for(command, bus.port, output)) == 2
    assert says in one_line(command, capsys)
    if isinstance(output, Path) and output.is_file():
        assert output.read_bytes() == b"a diary"


@pytest.mark.parametrize(
    ("output", "says"),
    [
        ("/dev/full", "no space left"),
        ("none/out", "no such file"),
        (".", "is a directory"),
        ("/", "/ is a directory"),
        ("/proc/out", "/proc"),
    ],
)
def test_outputs_of_decode(output: str, says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["decode", str(CYCLE), "-o", output]) == 2
    assert says in one_line("decode", capsys).lower()


@pytest.mark.parametrize(
    "words",
    [
        ["check", "IN", "--no-dissector", "--json", "OUT", "--junit", "OUT"],
        ["survey", "IN", "-o", "OUT", "--json", "OUT"],
        ["simulate", "-w", "OUT", "--truth", "OUT", "--duration", "1"],
        ["simulate", "SCENARIO", "-w", "OUT", "--truth", "SCENARIO"],
    ],
)
def test_two_outputs_of_one_name_are_refused(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The second would take the place of the first, or of what somebody wrote."""
    scenario = tmp_path / "scenario.toml"
    scenario.write_text("seconds = 1\n", encoding="utf-8")
    places = {"IN": str(CYCLE), "OUT": str(tmp_path / "out"), "SCENARIO": str(scenario)}
    assert main([places.get(word, word) for word in words]) == 2
    assert "another" in one_line(words[0], capsys)
    assert not (tmp_path / "out").exists()
    assert scenario.read_text(encoding="utf-8") == "seconds = 1\n"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["-w", "-"], "watch keeps a file of evidence, so -w - is not possible; use: dalyshark capture PORT -w -"),
        ([], "cannot make the folder captures here (File exists); name a file: -w FILE"),
        (["--bus", "a b"], "bus name 'a b' is not one word"),
        (["--baud", "fast"], "'fast' is not a baud rate, such as 9600"),
        (["--duration", "-1"], "'-1' is not a number of seconds above 0"),
        (["--baud", "12345"], "baud rate 12345 is not possible"),
    ],
)
def test_words_of_watch(
    words: list[str], says: str, bus: Bus, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "captures").write_text("a file", encoding="utf-8")
    try:
        status = main(["watch", bus.port, *words])
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert says in one_line("watch", capsys)
    assert [path.name for path in tmp_path.iterdir()] == ["captures"]


def test_a_port_that_is_not_there_leaves_nothing_behind(tmp_path: Path) -> None:
    assert main(["watch", "/dev/ttyUSB77"]) == 2
    assert list(tmp_path.iterdir()) == []


# Fuzz


@st.composite
def captures(draw: st.DrawFn) -> bytes:
    """Random bytes behind a magic, or a sample with bytes changed, left out, doubled, and perhaps compressed."""
    style = draw(st.integers(0, 3))
    if style == 0:
        data = draw(st.sampled_from([b"", WHOLE[:4], WHOLE[:28], CLASSIC[:4], CLASSIC[:24], b"\x1f\x8b"]))
        return data + draw(st.binary(max_size=300))
    data = bytearray(draw(st.sampled_from([WHOLE, CLASSIC, (SAMPLES / "made-damaged-bus.pcapng").read_bytes()])))
    for _ in range(draw(st.integers(1, 8))):
        at = draw(st.integers(0, len(data)))
        piece = draw(st.binary(max_size=12))
        match draw(st.integers(0, 3)):
            case 0:
                data[at : at + len(piece)] = piece
            case 1:
                data[at:at] = piece
            case 2:
                del data[at : at + draw(st.integers(1, 60))]
            case _:
                data[at:at] = data[at : at + draw(st.integers(1, 400))]
    return gzip.compress(bytes(data), 1)[: draw(st.integers(1, 1 << 16))] if style == 3 else bytes(data)


def read(path: Path) -> tuple[list[Packet], str]:
    """The packets of a capture as far as it can be read, and what is wrong with it."""
    packets: list[Packet] = []
    try:
        packets.extend(read_capture(path))
    except CaptureError as error:
        return packets, str(error)
    return packets, ""


@settings(max_examples=300, deadline=None)
@given(content=captures())
def test_any_bytes_are_records_or_one_kind_of_error(content: bytes, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz"
    path.write_bytes(content)
    packets, said = read(path)
    assert "\n" not in said
    assert not said or str(path) in said
    # What was whole is decoded, and no byte of a serial line is lost.
    records = list(decode(packets))
    there = sum(len(packet.data) for packet in packets if 147 <= packet.link_type <= 162)
    assert sum(len(record.data) for record in records) == there


@settings(max_examples=60, deadline=None)
@given(content=captures(), form=st.sampled_from(["table", "jsonl"]))
def test_decode_survives_any_bytes(content: bytes, form: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.getbasetemp()
    (folder / "fuzz").write_bytes(content)
    out = folder / "fuzz.out"
    out.unlink(missing_ok=True)
    assert main(["decode", str(folder / "fuzz"), "--format", form, "-o", str(out)]) in {0, 2}
    if out.exists():
        text = out.read_bytes().decode()
        assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]", text)


def test_the_fuzz_gets_past_the_header(tmp_path: Path) -> None:
    """Some of it is damaged behind whole packets, not only at its beginning."""

    def late(content: bytes) -> bool:
        path = tmp_path / "fuzz"
        path.write_bytes(content)
        packets, said = read(path)
        return bool(said) and any(ASK in packet.data for packet in packets)

    assert find(captures(), late)
