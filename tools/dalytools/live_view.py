# SPDX-License-Identifier: GPL-2.0-or-later
"""Each record decoded by the real tshark while it is captured: a pipe into tshark, lines out of it."""

from __future__ import annotations

import os
import subprocess
import threading
from typing import TYPE_CHECKING

from dalycapture.output import PipeOutput
from dalycapture.pcapng import PcapngWriter
from dalytools.terminal_text import plain
from dalytools.tshark import Tshark, lua_complaint

if TYPE_CHECKING:
    from collections.abc import Callable

_COLUMNS = 'gui.column.format:"No.","%m","Time","%t","Info","%i"'
_LAST_WORDS = 4096


class LiveView:
    """A tshark that reads what ``sink`` is given and calls ``show`` with each line, in a thread of its own."""

    def __init__(self, tshark: Tshark, show: Callable[[str], None], *, link_type: int, application: str) -> None:
        reader, writer = os.pipe()
        try:
            # Its own process group: Ctrl-C ends the capture, and tshark when it has shown the last record.
            self._process = tshark.start(
                ["-l", "-r", "-", "-o", f"daly.link_types:{link_type}", "-o", _COLUMNS],
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
        os.set_blocking(writer, False)
        self.sink = PcapngWriter(PipeOutput(writer, "tshark"), application=application)
        self._show = show
        self._messages = b""
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._lines, self._listen)]
        for thread in self._threads:
            thread.start()

    def _lines(self) -> None:
        stream = self._process.stdout
        assert stream is not None  # noqa: S101 - asked for above
        for line in stream:
            self._show(plain(line.decode("utf-8", errors="replace").strip()))

    def _listen(self) -> None:
        stream = self._process.stderr
        assert stream is not None  # noqa: S101 - asked for above
        for line in stream:
            self._messages = (self._messages + line)[-_LAST_WORDS:]

    def finish(self, patience_s: float = 10.0) -> str:
        """Wait until all is shown; return what was wrong with the view, "" for nothing. The sink is closed by now."""
        for thread in self._threads:
            thread.join(patience_s)
        if self._process.poll() is None:
            try:
                self._process.wait(patience_s)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
                return "tshark did not keep up and was ended; the capture file is complete"
        messages = self._messages.decode("utf-8", errors="replace")
        complaint = lua_complaint(messages)
        if complaint:
            return f"tshark: {plain(complaint)}"
        if self._process.returncode:
            last = messages.strip().splitlines()
            return f"tshark ended with status {self._process.returncode}: {plain(last[-1]) if last else 'no message'}"
        return ""
