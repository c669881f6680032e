# SPDX-License-Identifier: GPL-2.0-or-later
"""Each record decoded by the real tshark while it is captured: a pipe into tshark, lines out of it."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import threading
import time
from typing import TYPE_CHECKING

from dalycapture.output import PipeOutput
from dalycapture.pcapng import PcapngWriter
from dalytools.terminal_text import plain
from dalytools.tshark import Tshark, lua_complaint
from dalytools.wire_times import preferences

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalyref.options import Options

_COLUMNS = 'gui.column.format:"No.","%m","Time","%t","Info","%i"'
_LINE = re.compile(r" *(\d+) +(-?\d+\.\d+) ?(.*)")
_LAST_WORDS = 4096


class LiveView:
    """A tshark that reads what ``sink`` is given.

    show: called with a line for each packet, in a thread of this class's own. ended: called, in that thread too, with
    what is wrong when tshark ends otherwise than well; the capture need not care.
    """

    def __init__(
        self,
        tshark: Tshark,
        show: Callable[[str], None],
        ended: Callable[[str], None],
        *,
        options: Options,
        link_type: int,
        application: str,
    ) -> None:
        reader, writer = os.pipe()
        try:
            # Its own process group: Ctrl-C ends the capture, and tshark when it has shown the last record.
            self._process = tshark.start(
                ["-l", "-r", "-", *preferences(options), "-o", f"daly.link_types:{link_type}", "-o", _COLUMNS],
                stdin=reader,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                process_group=0,
            )
        except BaseException:
            os.close(writer)
            raise
        finally:
            os.close(reader)
        os.set_inheritable(writer, False)
        if os.name != "nt":  # a thread writes there, see PipeOutput
            os.set_blocking(writer, False)
        self.sink = PcapngWriter(PipeOutput(writer, "tshark"), application=application)
        self._show, self._ended = show, ended
        self._given_up = False
        self._messages = b""
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._listen, self._lines)]
        for thread in self._threads:
            thread.start()

    def _lines(self) -> None:
        stream = self._process.stdout
        assert stream is not None  # noqa: S101 - asked for above
        with stream:
            for line in stream:
                self._show(_line(line.decode("utf-8", errors="replace")))
        self._process.wait()
        self._threads[0].join()
        if complaint := self._complaint():
            self._ended(complaint)

    def _listen(self) -> None:
        stream = self._process.stderr
        assert stream is not None  # noqa: S101 - asked for above
        with stream:
            for line in stream:
                self._messages = (self._messages + line)[-_LAST_WORDS:]

    def _complaint(self) -> str:
        messages = self._messages.decode("utf-8", errors="replace")
        status = self._process.returncode
        if self._given_up:
            return "tshark did not keep up and was ended"
        if complaint := lua_complaint(messages):
            return plain(complaint)
        if status < 0:
            return f"tshark was ended by {signal.strsignal(-status) or f'signal {-status}'}"
        last = messages.strip().splitlines()[-1:] or ["it said nothing"]
        return f"tshark ended with status {status}: {plain(last[0])}" if status else ""

    def finish(self, patience_s: float = 10.0) -> None:
        """Wait until all is shown. The sink is closed by now; a tshark that hangs is ended."""
        end = time.monotonic() + patience_s
        for thread in self._threads:
            thread.join(max(0.0, end - time.monotonic()))
        if any(thread.is_alive() for thread in self._threads):
            self._given_up = True
            self._process.kill()
            for thread in self._threads:
                thread.join()


def _line(text: str) -> str:
    """Lay out a line of tshark's: number, seconds since the first packet, what it is."""
    text = text.rstrip("\r\n")
    found = _LINE.fullmatch(text)
    if not found:
        return plain(text)
    number, seconds, info = found.groups()
    return f"{number:>5} {float(seconds):10.3f}  {plain(info) or '(not decoded: an error in the dissector)'}"
