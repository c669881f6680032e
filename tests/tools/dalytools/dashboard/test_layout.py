# SPDX-License-Identifier: GPL-2.0-or-later
"""The lines of a screen, of several sizes, without a terminal."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.dashboard.heard import ALL, CELLS, PACK, STATUS, SWITCH_OFF, heard
from tests.tools.dalytools.made import a5

from dalytools.dashboard.cell_panel import scale
from dalytools.dashboard.glyphs import ASCII, UNICODE, glyphs_for
from dalytools.dashboard.layout import View, screen_lines
from dalytools.dashboard.state import State
from dalytools.dashboard.status import Key, Status, pack, unpack

if TYPE_CHECKING:
    from pathlib import Path

    from rich.text import Text

    from dalytools.dashboard.glyphs import Glyphs

STATUS_NOW = Status("/dev/ttyUSB0", 9600, "captures/x.pcapng", 72.5, 8, written=14_100)


def shown(
    state: State,
    width: int = 80,
    height: int = 24,
    *,
    selected: str = "1",
    now: float = 1.0,
    paused_s: float | None = None,
    glyphs: Glyphs = UNICODE,
    status: Status = STATUS_NOW,
) -> list[Text]:
    return screen_lines(View(state, status, selected, now, paused_s), width, height, glyphs)


def plain(lines: list[Text]) -> str:
    return "\n".join(line.plain.rstrip() for line in lines)


def style_at(lines: list[Text], word: str) -> str:
    """The styles of the first sign of a word."""
    for line in lines:
        at = line.plain.find(word)
        if at >= 0:
            return " ".join(str(span.style) for span in line.spans if span.start <= at < span.end)
    pytest.fail(f"{word} is not on the screen:\n{plain(lines)}")


def test_a_small_screen(tmp_path: Path) -> None:
    text = plain(shown(heard(tmp_path, [(0.5, frame) for frame in ALL])))
    for words in (
        r"^ /dev/ttyUSB0  9600 baud  0:01:12  14\.1 kB  captures/x\.pcapng$",
        r"^Bus +1\.6 records/s  8 good  0 bad  0 junk  0 unanswered$",  # 8 in the last 5 s
        r"^ +1  13\.2   -15\.4  62\.5   3280\.\.3310 \(30\)      3       8       0$",
        r"^── Board 1 ─+$",
        r"^Pack    13\.2 V  -15\.4 A  charging  -203 W  SOC ████░░ 62\.5 %  156\.2 Ah left$",  # 13.2 * -15.4 = -203.28
        r"^MOS     ● charge on  ○ discharge off  no charger  no load  0 cycles$",
        r"^Temp\.   1: 21 C  2: 19 C$",
        r"^Faults  ●2cell V  ○ pack V  ○ chg temp .*○ SOC$",
        r"^        ○ MOS  ● short  ○ other  cell_volt_high_level_1  cell_volt_high_level_2$",
        r"^        short_circuit_protect$",
        r"^Balance cells 1 3$",
        r"^── 4 cells: 3280 to 3310 mV, spread 30 mV, average 3295 mV   bars 3270 to 3320 ─+$",
        r"^ 1 █+▌?░+ 3300 b",
        r"^ 2 █+▌?░+ 3310▲$",
        r"^ 4 █+▌?░+ 3280▼$",
        r"^── Last records ─+$",
        r" board 1 +98 faults +cell_volt_high_level_1  cell_volt_high_level_2  short_circuit_protect",
        r"^ m  mark   p  pause   q  end the capture$",
    ):
        assert re.search(words, text, re.MULTILINE), f"{words} is not in\n{text}"


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 40), (200, 60), (40, 10), (20, 5), (10, 3), (1, 1)])
@pytest.mark.parametrize("cells", [0, 1, 4, 48])
def test_it_fills_a_screen_of_any_size(width: int, height: int, cells: int, tmp_path: Path) -> None:
    frames = [a5(1, 0x94, bytes((cells, 8)))]
    frames += [a5(1, 0x95, bytes((number, 12, 228, 12, 238, 12, 218))) for number in range(1, 17)]
    assert len(shown(heard(tmp_path, [(0.5, frame) for frame in (*frames, *ALL)]), width, height)) == height
    assert len(shown(State(), width, height, selected="")) == height


def test_48_cells_on_a_small_screen(tmp_path: Path) -> None:
    """Each cell is there: cell 3n+1 has 3300 mV + n, and the two after it have it too."""
    frames = [a5(1, 0x94, bytes((48, 1)))]
    frames += [a5(1, 0x95, bytes((number,)) + (3299 + number).to_bytes(2) * 3) for number in range(1, 17)]
    text = plain(shown(heard(tmp_path, [(0.5, frame) for frame in frames])))
    for cell in range(1, 49):
        assert re.search(rf"(^| ) ?{cell} {3300 + (cell - 1) // 3}\b", text, re.MULTILINE), (cell, text)


def test_old_values_are_marked(tmp_path: Path) -> None:
    state = heard(tmp_path, [(0.0, frame) for frame in (STATUS, *CELLS)] + [(8.0, PACK)])
    lines = shown(state, now=9.0)
    assert "no charger  no load  0 cycles  (9 s old)" in plain(lines)
    assert "average 3295 mV   9 s old" in plain(lines)
    assert "13.2 V  -15.4 A" in plain(lines)
    assert "italic" in style_at(lines, "no charger")
    assert "italic" in style_at(lines, "3310▲")
    assert "italic" not in style_at(lines, "13.2 V")
    assert "silent" not in plain(lines)
    assert "silent 5 min" in plain(shown(state, 100, now=308.0))


def test_writes_stand_out(tmp_path: Path) -> None:
    lines = shown(heard(tmp_path, [(0.1, SWITCH_OFF), (0.2, a5(1, 0xD9, b"\0"))]))
    assert re.search(r"^Written  1 write, the last at \S+: host 40 > board 1 WRITE D9 discharge MOS", plain(lines),
                     re.MULTILINE)  # fmt: skip
    assert style_at(lines, "1 write,") == "bold white on magenta"
    assert style_at(lines[10:], "host 40 > board 1") == "bold white on magenta"


def test_several_boards(tmp_path: Path) -> None:
    """More than there is room for: those around the selected one."""
    state = heard(tmp_path, [(0.5, a5(board, 0x90, bytes((0, board)))) for board in range(1, 16)])
    lines = shown(state, selected="12")
    text = plain(lines)
    assert "── Board 12 of 15 boards ──" in text
    assert "Pack    1.2 V" in text
    assert re.findall(r"^[> ] +(\d+) +\d\.\d ", text, re.MULTILINE) == ["10", "11", "12", "13"]
    assert "reverse" in style_at(lines, ">   12   1.2")
    assert "Tab  or number: board" in text


def test_trouble_of_the_capture() -> None:
    status = Status("/dev/ttyUSB0", 9600, "x.pcapng", lost=7, away=["/dev/ttyUSB0"], marks=2, records=1000)
    lines = shown(State(), selected="", status=status)
    assert "2 marks   7 LOST    WAITING FOR /dev/ttyUSB0 " in lines[0].plain
    assert style_at(lines, "7 LOST") == "bold white on red"
    assert "the screen is 1000 records behind" in plain(lines)
    assert "no board has answered yet" in plain(lines)


def test_a_long_name_shows_its_end() -> None:
    status = Status("/dev/ttyUSB0", 9600, f"/{'far/' * 50}away.pcapng")
    assert shown(State(), status=status)[0].plain.endswith("/far/away.pcapng ")
    assert len(shown(State(), status=status)[0].plain) == 80


def test_nothing_steers_the_terminal(tmp_path: Path) -> None:
    """Texts of the bus, comments and names are hostile."""
    texts = [a5(1, 0x56, b"\x01\x1b[2J\x9b1m"), a5(1, 0x57, b"\x01\x07\x08\r\n\x00\xff\xfe"), b""]
    state = heard(tmp_path, [(0.5, data) for data in texts], comment="\x1b]0;gone\x07\u202e\r")
    status = Status("/dev/\x1b[1mtty", 9600, "\x1bc\n.pcapng", away=["\x07"])
    for line in shown(state, 200, 40, status=status):
        assert line.plain.isprintable(), line.plain
    assert r"\x1b]0;gone\x07" in plain(shown(state, 200, 40))


def test_without_unicode(tmp_path: Path) -> None:
    text = plain(shown(heard(tmp_path, [(0.5, frame) for frame in ALL]), glyphs=ASCII))
    assert text.isascii()
    assert "*2cell V  o pack V" in text
    assert "3310^" in text


@pytest.mark.parametrize(
    ("environment", "glyphs"),
    [
        ({"LANG": "de_DE.UTF-8"}, UNICODE),
        ({"LC_ALL": "C.utf8", "LANG": "C"}, UNICODE),
        ({"LC_ALL": "C", "LANG": "de_DE.UTF-8"}, ASCII),
        ({"LANG": "de_DE.ISO-8859-1"}, ASCII),
        ({}, ASCII),
    ],
)
def test_signs_by_the_locale(environment: dict[str, str], glyphs: Glyphs) -> None:
    assert glyphs_for(environment) is glyphs


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [(3300, 3300, (3290, 3310)), (3307, 3312, (3300, 3320)), (3280, 3310, (3270, 3320)), (2900, 3600, (2800, 3800)),
     (0, 4000, (0, 5000)), (0, 0, (0, 10)), (0, 65535, (0, 100_000))],
)  # fmt: skip
def test_bars_begin_and_end_at_round_numbers(low: int, high: int, expected: tuple[int, int]) -> None:
    assert scale(low, high) == expected


def test_messages_arrive_as_they_were() -> None:
    status = Status("p", 1, "f", 2.5, 3, 4, 5, 6, ["x"])
    assert unpack(pack(status)) == status
    assert unpack(pack(Key("\t"))) == Key("\t")


def test_paused() -> None:
    assert "p  go on" in plain(shown(State(), paused_s=3.2))
    assert "PAUSED 3 s" in plain(shown(State(), paused_s=3.2))


def test_a_sensor_that_is_not_there_has_no_temperature(tmp_path: Path) -> None:
    """Byte 00 is no sensor (field notes, a.92), and was shown as -40 C."""
    sensors = a5(1, 0x96, bytes((1, 40 + 21, 0, 255)))
    text = plain(shown(heard(tmp_path, [(0.5, a5(1, 0x94, bytes((4, 3)))), (0.5, sensors)])))
    assert "Temp.   1: 21 C  2: none  3: none" in text
    extremes = a5(1, 0x92, bytes((40 + 21, 1, 0, 2)))
    assert "Temp.   21 C\n" in plain(shown(heard(tmp_path, [(0.5, extremes)])))
