# SPDX-License-Identifier: GPL-2.0-or-later
"""An adapter that went away is waited for, and opened again with the same settings: that adapter, not another one."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Final

from dalycapture.adapters import find_again
from dalycapture.errors import PortError
from dalycapture.opening import open_port

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalycapture.port import Port
    from dalycapture.settings import Settings

LOOK_EVERY_S: Final = 0.02
FIRST_PAUSE_S, LONGEST_PAUSE_S = 0.1, 2.0  # after it could not be opened: each opening raises RTS and DTR


def can_come_back(name: str) -> bool:
    """Tell whether a port of that name may be waited for. A pseudo-terminal's number goes to somebody else."""
    return "://" in name or Path(name).is_symlink() or not os.path.realpath(name).startswith("/dev/pts/")


class Replug:
    """Looks for a port that went away, in a thread of its own, and calls ``found`` when it is open again."""

    def __init__(self, port: Port, settings: Settings, found: Callable[[], None]) -> None:
        self._name, self._before, self._settings = port.name, port.facts.adapter, settings
        self._found = found
        self._stopping = threading.Event()
        self._lock = threading.Lock()
        self._port: Port | None = None
        self._thread = threading.Thread(target=self._look, name=f"waiting for {port.name}", daemon=True)
        self._thread.start()

    def _look(self) -> None:
        pause = FIRST_PAUSE_S
        while not self._stopping.wait(LOOK_EVERY_S):
            name = self._name if "://" in self._name else find_again(self._name, self._before)
            if not name:
                continue
            try:
                port = open_port(name, self._settings)
            except PortError:
                self._stopping.wait(pause)
                pause = min(2 * pause, LONGEST_PAUSE_S)
                continue
            with self._lock:
                if self._stopping.is_set():
                    port.close()
                    return
                self._port = port
            self._found()
            return

    def take(self) -> Port | None:
        """Take the port, if it is back."""
        with self._lock:
            port, self._port = self._port, None
            return port

    def stop(self) -> None:
        """Look no more."""
        self._stopping.set()
        with self._lock:
            if self._port:
                self._port.close()
                self._port = None
        self._thread.join(0.2)  # a connection that is being tried may take longer; nobody waits for it
