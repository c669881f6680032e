# SPDX-License-Identifier: GPL-2.0-or-later
"""Another Wireshark reads the samples as tshark does.

The other one is Wireshark 4.4.5 compiled to WebAssembly, with Lua 5.4: another word size (32 bits), another C library,
another Lua than tshark 4.0's (5.2). It decodes as the GUI does: every packet once, in order, when the file is loaded,
and again when it is looked at, which is what tshark does with `-2`. Item by item, and in the Info column, both must
agree.
"""

import json
import re
import struct
import subprocess
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from dalytools.tshark import Tshark, lua_complaint

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = sorted(path for path in (ROOT / "pcap_samples").iterdir() if path.suffix in {".pcap", ".pcapng"})

Value = str | float | None
Item = tuple[str, Value]


@dataclass(frozen=True)
class Packet:
    """What one Wireshark says of one packet: two columns, and the daly items in the order of the tree."""

    protocol: str
    info: str
    items: list[Item]


def plain(text: str | None) -> Value:
    """One spelling for a value that two programs spell differently: numbers and booleans become a float."""
    if not text:
        return None
    if text in {"True", "False"}:
        return float(text == "True")
    try:
        return float(int(text, 16)) if text.startswith("0x") else float(f"{float(text):.12g}")
    except ValueError:
        return text


def literal(text: str | None) -> Value:
    """A display filter's literal as a value: strings stand in quotes, with backslashes; one byte alone is `20:`."""
    if text is not None and text.startswith('"'):
        return plain(re.sub(r"\\(.)", r"\1", text[1:-1]))
    return plain(text.removesuffix(":") if text else text)


def node(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    script = ROOT / "tests" / "matrix" / "wiregasm_run.mjs"
    command = [ROOT / ".venv" / "bin" / "node", script, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)


@cache
def wiregasm_views() -> dict[str, list[Packet]]:
    """All samples as the WebAssembly Wireshark sees them, by file name. One run: starting takes the most time."""
    run = node(*SAMPLES)
    assert run.returncode == 0, run.stderr
    views: dict[str, list[Packet]] = {}
    packets: list[Packet] = []
    for line in run.stdout.splitlines():
        said: dict[str, Any] = json.loads(line)
        if "capture" in said:
            packets = views[Path(said["capture"]).name] = []
        elif "number" in said:
            assert said["number"] == len(packets) + 1
            items = [(name, literal(value)) for name, value in said["fields"]]
            packets.append(Packet(said["protocol"], said["info"], items))
    return views


@pytest.fixture(scope="module")
def tshark() -> Iterator[Tshark]:
    with Tshark() as program:
        yield program


def output(tshark: Tshark, capture: Path, *arguments: str) -> str:
    run = tshark.run("-2", "-r", str(tshark.readable(capture)), *arguments)
    messages = run.stderr.decode(errors="replace")
    assert lua_complaint(messages) is None
    assert run.returncode == 0, messages
    return run.stdout.decode()


def tshark_view(tshark: Tshark, capture: Path) -> list[Packet]:
    # The columns' names were capitals up to 4.2; either version leaves the other's empty.
    columns = ("_ws.col.Protocol", "_ws.col.protocol", "_ws.col.Info", "_ws.col.info")
    table = output(tshark, capture, "-T", "fields", *(part for column in columns for part in ("-e", column)))
    rows = [row.split("\t") for row in table.removesuffix("\n").split("\n")]
    trees = ET.fromstring(output(tshark, capture, "-T", "pdml")).findall("packet")
    return [
        Packet(
            row[0] or row[1],
            row[2] or row[3],
            [
                (name, plain(item.get("show")) if item.tag == "field" else None)
                for item in tree.iter()
                if (name := item.get("name", "")) == "daly" or name.startswith("daly.")
            ],
        )
        for row, tree in zip(rows, trees, strict=True)
    ]


def test_there_are_samples() -> None:
    assert SAMPLES


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda sample: sample.name)
def test_same_packets_columns_and_items(tshark: Tshark, sample: Path) -> None:
    theirs, ours = wiregasm_views()[sample.name], tshark_view(tshark, sample)
    assert len(theirs) == len(ours)
    for number, (their, our) in enumerate(zip(theirs, ours, strict=True), start=1):
        assert their == our, f"packet {number}"


# --- the runner itself: what goes wrong in there must not pass for agreement ------------------------------------------


@pytest.fixture
def one_byte(tmp_path: Path) -> Path:
    """A classic pcap, link type USER0, of one packet of one byte."""
    header = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 147)
    capture = tmp_path / "one.pcap"
    capture.write_bytes(header + struct.pack("<IIII", 1, 0, 1, 1) + b"\xa5")
    return capture


def with_script(folder: Path, lua: str) -> Path:
    plugins = folder / "plugins"
    plugins.mkdir()
    (plugins / "daly.lua").write_text(lua, encoding="utf-8")
    return plugins


WHOLE = """
local proto = Proto("daly", "Daly")
proto.fields = { ProtoField.double("daly.soc", "SOC"), ProtoField.string("daly.kind", "Kind") }
function proto.dissector(tvb, pinfo, tree)
  local item = tree:add(proto, tvb())
  item:add(proto.fields[1], tvb(), 873 / 10)
  item:add(proto.fields[2], 'a"b\\\\c')
  pinfo.cols.info = "seen"
end
DissectorTable.get("wtap_encap"):add(wtap.USER0, proto)
"""


def test_runner_tells_columns_and_items(one_byte: Path, tmp_path: Path) -> None:
    run = node("--plugins", with_script(tmp_path, WHOLE), one_byte)
    assert (run.returncode, run.stderr) == (0, "")
    program, capture, packet = (json.loads(line) for line in run.stdout.splitlines())
    assert program == {"wireshark": "4.4.5", "lua": "Lua 5.4", "scripts": ["daly.lua"]}
    assert capture == {"capture": str(one_byte), "packets": 1}
    assert packet["info"] == "seen"
    items = [(name, literal(value)) for name, value in packet["fields"]]
    assert items == [("daly", None), ("daly.soc", 87.3), ("daly.kind", 'a"b\\c')]


@pytest.mark.parametrize(
    ("lua", "word"),
    [
        ("x = = 1", "unexpected symbol"),
        (WHOLE.replace('pinfo.cols.info = "seen"', "error('boom')"), "boom"),
        (WHOLE.replace("873 / 10", "'much'"), "Lua Error"),
    ],
    ids=["does not parse", "raises", "wrong type"],
)
def test_runner_fails_on_lua_errors(one_byte: Path, tmp_path: Path, lua: str, word: str) -> None:
    run = node("--plugins", with_script(tmp_path, lua), one_byte)
    assert run.returncode == 1
    assert word in run.stderr


def test_runner_fails_on_what_is_no_capture(tmp_path: Path) -> None:
    capture = tmp_path / "no.pcapng"
    capture.write_text("no capture\n", encoding="utf-8")
    run = node("--plugins", with_script(tmp_path, WHOLE), capture)
    assert run.returncode == 1
    assert "no.pcapng" in run.stderr
