# SPDX-License-Identifier: GPL-2.0-or-later
"""The page as a browser shows it: plots are drawn, nothing is fetched, text of a capture stays text."""

from __future__ import annotations

import json
import re
import subprocess
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from tests.tools.dalytools.made import a5, write

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalytools.cli import main

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[4]
SAMPLES = ROOT / "pcap_samples"
EVIL = "</script><script>document.title='taken'</script><img src=x onerror=\"document.title='taken'\">\x1b[2J"


def browse(page: Path, folder: Path, *, width: int = 1280) -> str:
    """Open a page in a browser, let it run; return the document that it then has."""
    words = [
        "chromium", "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync",
        f"--user-data-dir={folder / 'browser'}", f"--window-size={width},1600", "--virtual-time-budget=10000",
        "--dump-dom", page.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=True)
    return done.stdout


def figures(page: Path) -> list[dict[str, list[dict[str, Any]]]]:
    """Return the figures in a page."""
    found = re.search(
        r'<script type="application/json" id="figures">(.*?)</script>', page.read_text("utf-8"), re.DOTALL
    )
    assert found
    return json.loads(found[1])


@pytest.fixture(scope="module")
def faults(tmp_path_factory: pytest.TempPathFactory) -> Path:
    page = tmp_path_factory.mktemp("report") / "faults.html"
    assert (
        main(["report", str(SAMPLES / "made-faults.pcapng"), str(SAMPLES / "made-poll-cycle.pcapng"), "-o", str(page)])
        == 0
    )
    return page


def traces(page: Path, name: str) -> Iterator[dict[str, Any]]:
    for figure in figures(page):
        yield from (trace for trace in figure["data"] if trace["name"] == name)


def test_a_browser_draws_every_figure(faults: Path, tmp_path: Path) -> None:
    document = browse(faults, tmp_path)
    assert 'data-ready="2"' in document  # the bus and one board
    assert document.count("main-svg") >= 2
    assert "cell_volt_high_level_1" in document


def test_a_phone_draws_it_too(faults: Path, tmp_path: Path) -> None:
    document = browse(faults, tmp_path, width=390)
    widths = [int(width) for width in re.findall(r'class="main-svg"[^>]*width="(\d+)"', document)]
    assert widths
    assert max(widths) <= 500  # a headless window is at least so wide


def test_nothing_is_fetched(faults: Path) -> None:
    text = faults.read_text("utf-8")
    assert "default-src 'none'" in text
    own = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert not re.search(r"(src|href)\s*=", own)


def test_faults_stand_where_they_came_and_went(faults: Path) -> None:
    """By hand from the sample (docs: made-faults): raised at 0.689713203 s in packet 12, cleared 2.042 s later."""
    (trace,) = traces(faults, "cell_volt_high_level_1")
    (start, end) = trace["x"]
    assert (end - start) / 1000 == pytest.approx(2.042, abs=0.001)


def test_cells_are_those_of_the_capture(faults: Path) -> None:
    (trace,) = traces(faults, "cell 11")
    assert set(trace["y"]) <= {3286, 3287}


def test_text_of_a_capture_stays_text(tmp_path: Path) -> None:
    capture, page = tmp_path / "evil.pcapng", tmp_path / "evil.html"
    frame = bytes.fromhex("a501900800f80000753001815d")
    with open_writer(capture) as writer:
        writer.add_interface(Interface(name=EVIL, description=f"dalyshark {EVIL}"))
        writer.write_packet(1_700_000_000_000_000_000, frame)
        writer.write_packet(1_700_000_000_100_000_000, b"", comment=EVIL)
    assert main(["report", str(capture), "-o", str(page), "--title", EVIL]) == 0
    assert EVIL not in page.read_text("utf-8")
    document = browse(page, tmp_path)
    title = re.search(r"<title>(.*?)</title>", document, re.DOTALL)
    assert title
    assert title[1].startswith("&lt;/script&gt;")
    assert "\x1b" not in document


def test_what_cannot_be_reported_is_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.html"
    assert main(["report", str(tmp_path / "none.pcapng"), "-o", str(out)]) == 2
    assert main(["report", str(SAMPLES / "made-faults.pcapng"), "-o", str(SAMPLES / "made-faults.pcapng")]) == 2
    said = capsys.readouterr().err
    assert "none.pcapng" in said
    assert "name another file" in said
    assert "Traceback" not in said
    assert not out.exists()


def test_what_was_found_has_its_time_and_says_what_to_do_once(faults: Path) -> None:
    text = faults.read_text("utf-8")
    assert text.count(">fault-raised<") > 1
    assert text.count("see what the battery did at that time") == 1
    assert re.search(
        r"made-faults.pcapng: board 1, \w+: raised 1 time.*?<div class=\"faint\">packet \d+, 2026-01-01 \d\d:\d\d:",
        text,
    )


def test_times_are_those_of_the_plots_wherever_the_reader_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By hand from the sample: packet 12 at 0.689713203 s; plots have UTC."""
    monkeypatch.setenv("TZ", "America/New_York")
    time.tzset()
    try:
        page = tmp_path / "page.html"
        assert main(["report", str(SAMPLES / "made-faults.pcapng"), "-o", str(page)]) == 0
    finally:
        monkeypatch.undo()
        time.tzset()
    assert ">packet 12, 2026-01-01 00:00:00.689 UTC<" in page.read_text("utf-8")


def test_a_capture_of_tcp_says_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "clean-tcp", "--duration", "3", "-w", str(tmp_path / "tcp.pcapng")]) == 0
    for words in (["report", "-o", str(tmp_path / "x.html")], ["survey"], ["decode"]):
        capsys.readouterr()
        assert main([*words, str(tmp_path / "tcp.pcapng")]) == 2
        assert "its link type is 1 (Ethernet); what is read is" in capsys.readouterr().err
    assert main(["report", str(tmp_path / "tcp.pcapng"), "--tcp-ports", "8899", "-o", str(tmp_path / "x.html")]) == 0


def test_many_cells_leave_room_for_the_plots_on_a_phone(tmp_path: Path) -> None:
    """With 48 cells the legend took half of the plots' height, and the buttons hid the first heading."""
    page = tmp_path / "cells.html"
    assert main(["report", str(SAMPLES / "made-48-cells.pcapng"), "-o", str(page)]) == 0
    phone, desk = browse(page, tmp_path, width=500), browse(page, tmp_path, width=1280)
    assert "cell 48</text>" not in phone
    assert "cell 48</text>" in desk
    assert 'class="modebar-btn"' not in phone
    assert 'class="modebar-btn"' in desk


def test_a_sensor_that_is_not_there_has_no_line(tmp_path: Path) -> None:
    """Bytes 00 and FF are no sensor (field notes, a.92), not -40 and 215 C; 61 is 21 C, 54 is 14 C."""
    asked, told = a5(0x40, 0x96), a5(1, 0x96, bytes((1, 61, 0, 54, 255, 255, 255, 255)))
    frames = [a5(1, 0x94, bytes((4, 4))), asked, told, asked, told]
    path = write(tmp_path / "sensors.pcapng", [(number * 0.1, frame) for number, frame in enumerate(frames)])
    assert main(["report", str(path), "-o", str(tmp_path / "sensors.html")]) == 0
    drawn = {trace["name"]: trace["y"] for figure in figures(tmp_path / "sensors.html") for trace in figure["data"]}
    assert {name: set(values) for name, values in drawn.items() if "sensor" in name} == {
        "sensor 1": {21},
        "sensor 3": {14},
    }


def test_captures_are_put_in_the_order_of_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By name b comes behind a, by time before it: drawn from left to right all the same, and within the axis."""
    volts = {"a": ("0218", 1_700_000_100), "b": ("0210", 1_700_000_000)}  # 53.6 V, 52.8 V
    for name, (voltage, second) in volts.items():
        with open_writer(tmp_path / name) as writer:
            writer.add_interface(Interface("made", "dalyshark bus=main", 147))
            body = bytes.fromhex(f"a5019008{voltage}0000753001f4")
            writer.write_packet(second * 1_000_000_000, body + bytes((sum(body) % 256,)))
    page = tmp_path / "page.html"
    assert main(["report", str(tmp_path / "a"), str(tmp_path / "b"), "-o", str(page)]) == 0
    (trace,) = traces(page, "voltage")
    assert trace["y"] == [52.8, 53.6]
    assert trace["x"] == [1_700_000_000_000, 1_700_000_100_000]
    layout: Any = figures(page)[0]["layout"]
    assert layout["xaxis"]["range"] == trace["x"]
    assert capsys.readouterr().err == ""


def test_captures_of_one_time_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = [str(SAMPLES / name) for name in ("made-faults.pcapng", "made-poll-cycle.pcapng")]
    assert main(["report", *names, "-o", str(tmp_path / "page.html")]) == 0
    assert capsys.readouterr().err == (
        f"dalyshark report: {names[1]} begins before the capture in front of it ends: "
        "values of one board share a line\n"
    )


def test_to_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["report", str(SAMPLES / "made-faults.pcapng"), "-o", "-"]) == 0
    assert capsys.readouterr().out.startswith("<!DOCTYPE html>")


def test_nothing_is_drawn_over_a_night_without_a_word(tmp_path: Path) -> None:
    """Two times twenty seconds, twelve hours apart: cell 2 balances in the first only."""
    frames: list[tuple[float, bytes]] = []
    for start, mask in ((0, "02"), (43_200, "00")):
        for second in range(start, start + 20):
            frames += [(second, a5(1, 0x90, bytes.fromhex("02100000753001f4")))]
            frames += [(second + 0.5, a5(1, 0x97, bytes.fromhex(mask + "00" * 7)))]
    page = tmp_path / "page.html"
    assert main(["report", str(write(tmp_path / "in.pcapng", frames)), "-o", str(page)]) == 0
    (volts,) = traces(page, "voltage")
    assert volts["y"] == [52.8] * 20 + [None] + [52.8] * 20
    (map_,) = traces(page, "balancing")
    first, second = (row for row in map_["z"])
    assert (first, second) == ([0] * 20 + [None] * 2 + [0] * 20, [1] * 20 + [None] * 2 + [0] * 20)
    assert map_["x"][20] - map_["x"][19] == map_["x"][22] - map_["x"][21] == pytest.approx(43_219 * 2)  # a pixel
