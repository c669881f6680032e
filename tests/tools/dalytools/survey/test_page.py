# SPDX-License-Identifier: GPL-2.0-or-later
"""The page as a browser shows it: nothing is fetched, text of a capture stays text, a phone is wide enough."""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING

from tests.tools.dalytools.made import EPOCH_NS, a5
from tests.tools.dalytools.report.test_report import browse
from tests.tools.dalytools.survey.planted import Bus

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalytools.cli import main

if TYPE_CHECKING:
    from pathlib import Path

EVIL = "</style><script>document.title='taken'</script><img/src=x/onerror=\"document.title='taken'\">\x1b[2J"


def test_a_browser_shows_it(tmp_path: Path) -> None:
    bus, page = Bus(100), tmp_path / "survey.html"
    capture = bus.write(tmp_path / "a.pcapng", {0xE0: lambda poll: bytes((poll, *bus.noise(7)))})
    assert main(["survey", str(capture), "-o", str(page)]) == 0
    text = page.read_text("utf-8")
    assert "default-src 'none'" in text
    assert not re.search(r"<script|\ssrc=|\shref=", text)
    document = browse(page, tmp_path, width=390)
    assert "counts up by 1 each time" in document
    assert document.count('class="bits"') >= 16  # two places that move
    assert "flipped 99 of 99" in document  # bit 0 of the counter


def test_text_of_a_capture_stays_text(tmp_path: Path) -> None:
    capture, page = tmp_path / f"evil<b>{chr(27)}.pcapng", tmp_path / "evil.html"
    with open_writer(capture) as writer:
        for name in (f"dalyshark bus={EVIL.replace(' ', '_')}", "dalyshark bus=other"):
            writer.add_interface(Interface("made", name, 147))
        for number in range(4):
            writer.write_packet(EPOCH_NS + number * 10**9, a5(1, 0xE0, b"<script>"), interface=number % 2)
    assert main(["survey", str(capture), "-o", str(page)]) == 0
    assert "<script" not in page.read_text("utf-8")
    document = browse(page, tmp_path)
    title = re.search(r"<title>(.*?)</title>", document, re.DOTALL)
    assert title
    assert title[1].startswith("Survey of evil&lt;b&gt;")
    assert "\x1b" not in document
    assert "&lt;/style&gt;" in document  # the bus is named


def test_a_difference_is_a_page_too(tmp_path: Path) -> None:
    def still(value: int, _: int) -> bytes:
        return bytes((value, *bytes(7)))

    page = tmp_path / "difference.html"
    captures = [str(Bus(30).write(tmp_path / f"{value}.pcapng", {0xE0: partial(still, value)})) for value in (1, 2)]
    assert main(["survey", "--diff", *captures, "-o", str(page)]) == 0
    assert "01 before, 02 now (bits 0, 1)" in browse(page, tmp_path)
