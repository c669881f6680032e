# SPDX-License-Identifier: GPL-2.0-or-later
"""The capture's side of the dashboard: starts it, feeds it, tells it keys, and puts the terminal right after it."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
from typing import TYPE_CHECKING, Final

from dalycapture.output import PipeOutput
from dalycapture.pcapng import PcapngWriter
from dalytools.dashboard.screen import END
from dalytools.dashboard.status import Key, Status, pack
from dalytools.terminal_text import plain

if TYPE_CHECKING:
    from collections.abc import Callable

_LAST_WORDS: Final = 4096


def has_screen() -> bool:
    """Tell whether standard output is a terminal that a dashboard can be drawn on."""
    return os.name == "posix" and sys.stdout.isatty() and os.environ.get("TERM", "dumb") not in {"dumb", ""}


class DashboardView:
    """A dashboard of what ``sink`` is given, on standard output.

    ended: called, in a thread of this class's own, with what is wrong when the dashboard ends before ``finish`` or
    otherwise than well; the terminal is right again then, and the capture need not care.
    """

    def __init__(self, ended: Callable[[str], None], *, baud: int, application: str) -> None:
        reader, writer = os.pipe()
        self._messages, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._messages.setblocking(False)
        try:
            # Its own process group: Ctrl-C ends the capture, and the dashboard when it has shown the last record.
            self._process = subprocess.Popen(  # noqa: S603
                [sys.executable, "-P", "-m", "dalytools.dashboard", str(theirs.fileno()), str(baud)],
                stdin=reader,
                stderr=subprocess.PIPE,
                pass_fds=[theirs.fileno()],
                process_group=0,
            )
        except BaseException:
            os.close(writer)
            self._messages.close()
            raise
        finally:
            os.close(reader)
            theirs.close()
        os.set_inheritable(writer, False)
        os.set_blocking(writer, False)
        self.sink = PcapngWriter(PipeOutput(writer, "dashboard"), application=application)
        self._ended = ended
        self._finishing = self._given_up = False
        self._waiter = threading.Thread(target=self._wait, name="dashboard", daemon=True)
        self._waiter.start()

    def tell(self, message: Status | Key) -> None:
        """Tell it something; left out when it does not keep up."""
        with contextlib.suppress(OSError):
            self._messages.send(pack(message))

    def _wait(self) -> None:
        stream = self._process.stderr
        assert stream is not None  # noqa: S101 - asked for above
        messages = b""
        with stream:
            for line in stream:
                messages = (messages + line)[-_LAST_WORDS:]
        status = self._process.wait()
        if status == 0 and self._finishing:
            return
        with contextlib.suppress(OSError):
            os.write(sys.stdout.fileno(), END.encode())
        self._ended(self._complaint(status, messages.decode("utf-8", errors="replace")))

    def _complaint(self, status: int, messages: str) -> str:
        if self._given_up:
            return "it did not keep up and was ended"
        if status < 0:
            return f"it was ended by {signal.strsignal(-status) or f'signal {-status}'}"
        last = messages.strip().splitlines()[-1:] or ["it said nothing"]
        return plain(last[0]) if status else "it ended"

    def finish(self, patience_s: float = 3.0) -> None:
        """Wait until it has put the screen away. The sink is closed by now; a dashboard that hangs is ended."""
        self._finishing = True
        self._waiter.join(patience_s)
        if self._waiter.is_alive():
            self._given_up = True
            self._process.kill()
            self._waiter.join()
        self._messages.close()
