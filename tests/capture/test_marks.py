# SPDX-License-Identifier: GPL-2.0-or-later
"""Marks of line errors, as termios(3) describes PARMRK."""

from __future__ import annotations

import os
import termios
import tty

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dalycapture.marks import Unmarker


@pytest.mark.parametrize(
    ("raw", "data", "errors", "breaks"),
    [
        ("a5 40 90", "a5 40 90", [], []),
        ("a5 ff ff 00 ff ff 01", "a5 ff 00 ff 01", [], []),  # as capture notes, section 2, saw it
        ("a5 ff 00 41 08", "a5 41 08", [1], []),
        ("a5 ff 00 00 08", "a5 08", [], [1]),
        ("ff 00 ff", "ff", [0], []),  # FF itself, received badly
        ("ff ff ff 00 41", "ff 41", [1], []),
        ("ff 00 00 ff 00 00", "", [], [0, 0]),
        ("ff 41", "ff 41", [], []),
    ],
)
def test_marks(raw: str, data: str, errors: list[int], breaks: list[int]) -> None:
    assert Unmarker().feed(bytes.fromhex(raw)) == (bytes.fromhex(data), errors, breaks)


def test_what_is_held_at_the_end_is_not_lost() -> None:
    unmarker = Unmarker()
    assert unmarker.feed(b"\xa5\xff").data == b"\xa5"
    assert unmarker.flush() == b"\xff"
    assert unmarker.feed(b"\xff\xff").data == b"\xff"


received = st.one_of(
    st.tuples(st.just("good"), st.integers(0, 255)),
    st.tuples(st.just("bad"), st.integers(1, 255)),
    st.tuples(st.just("break"), st.just(0)),
)


@given(st.lists(received, max_size=40), st.data())
def test_however_it_is_torn(line: list[tuple[str, int]], data: st.DataObject) -> None:
    raw = b""
    for what, value in line:
        raw += bytes([0xFF, 0, value]) if what != "good" else bytes([value]) if value != 0xFF else b"\xff\xff"
    unmarker, out, errors, breaks = Unmarker(), b"", list[int](), list[int]()
    while raw:
        size = data.draw(st.integers(1, len(raw)))
        got = unmarker.feed(raw[:size])
        errors += [len(out) + at for at in got.errors]
        breaks += [len(out) + at for at in got.breaks]
        out += got.data
        raw = raw[size:]
    kept = [(what, value) for what, value in line if what != "break"]
    assert out == bytes(value for _, value in kept)
    assert errors == [at for at, (what, _) in enumerate(kept) if what == "bad"]
    assert len(breaks) == sum(what == "break" for what, _ in line)
    assert unmarker.flush() == b""


def test_the_kernel_doubles_ff_so() -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    attributes = termios.tcgetattr(slave)
    attributes[0] |= termios.PARMRK | termios.INPCK
    termios.tcsetattr(slave, termios.TCSANOW, attributes)
    os.write(master, bytes(range(256)))
    raw = b""
    while len(raw) < 257:
        raw += os.read(slave, 4096)
    assert Unmarker().feed(raw) == (bytes(range(256)), [], [])
    os.close(master)
    os.close(slave)
