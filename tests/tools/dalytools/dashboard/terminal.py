# SPDX-License-Identifier: GPL-2.0-or-later
"""A real terminal, tmux, with ``dalyshark watch`` in it: what it shows, keys, and what is left when it has ended."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from types import TracebackType

WATCH = [sys.executable, "-c", "from dalytools.cli import entry; entry()", "watch"]


def until(condition: Callable[[], object], why: Callable[[], str] = lambda: "it did not come") -> None:
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end, why()
        time.sleep(0.05)


class Terminal:
    """A terminal of its own server; its shell runs ``watch`` with these words, then says how it ended, and waits."""

    def __init__(
        self, folder: Path, *words: object, width: int = 80, height: int = 24, env: dict[str, str] | None = None
    ) -> None:
        self._socket = str(folder / "tmux")
        self._folder = folder
        self._env = {"LC_ALL": "C.UTF-8"} | (env or {})
        self._words = shlex.join([*WATCH, *map(str, words)])
        self._size = ["-x", str(width), "-y", str(height)]

    def __enter__(self) -> Self:
        settings = " ".join(f"export {name}={shlex.quote(value)};" for name, value in self._env.items())
        # The shell stands between, as an interactive one does: a terminal whose keys are off would be seen in its stty.
        script = (
            f"trap : INT; unset NO_COLOR; {settings} stty -a >before; {self._words} 2>errors; echo status $? >ended; "
            "stty -a >after; cat errors; echo THE END; sleep 1000"
        )
        self._tmux("-f", "/dev/null", "new-session", "-d", *self._size, "-c", str(self._folder), "sh", "-c", script)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._tmux("kill-server")

    def _tmux(self, *words: str) -> str:
        environment = {name: value for name, value in os.environ.items() if name != "TMUX"} | {"LC_ALL": "C.UTF-8"}
        done = subprocess.run(
            ["tmux", "-u", "-S", self._socket, *words], capture_output=True, check=True, text=True, env=environment
        )
        return done.stdout

    def screen(self, *, colours: bool = False) -> str:
        return self._tmux("capture-pane", "-p", *["-e"] * colours)

    def press(self, *keys: str) -> None:
        """Keys in tmux's words: m, Tab, C-c."""
        self._tmux("send-keys", *keys)

    def resize(self, width: int, height: int) -> None:
        self._tmux("resize-window", "-x", str(width), "-y", str(height))

    def until(self, *words: str) -> str:
        """Wait until all of this is on the screen; the screen."""
        until(lambda: all(word in self.screen() for word in words), lambda: f"{words} not in\n{self.screen()}")
        return self.screen()

    @property
    def on(self) -> bool:
        """Whether a program has the other screen."""
        return self._tmux("display-message", "-p", "#{alternate_on}").strip() == "1"

    def keys_of_the_system(self) -> str:
        """What stty says of the terminal now."""
        tty = self._tmux("display-message", "-p", "#{pane_tty}").strip()
        return subprocess.run(["stty", "-F", tty, "-a"], capture_output=True, check=True, text=True).stdout

    def pid(self) -> int:
        """Process number of ``watch``."""
        shell = self._tmux("display-message", "-p", "#{pane_pid}").strip()
        return int(subprocess.run(["pgrep", "-P", shell], capture_output=True, check=True, text=True).stdout)

    def dashboard(self) -> int:
        """Process number of the dashboard."""
        words = ["pgrep", "-f", "-P", str(self.pid()), "dalytools.dashboard"]
        return int(subprocess.run(words, capture_output=True, check=True, text=True).stdout)

    def ended(self, status: int, *words: str) -> str:
        """Wait until ``watch`` has ended, and see that nothing is left of it on the terminal; what stands there."""
        self.until("THE END")
        assert (self._folder / "ended").read_text() == f"status {status}\n", self.screen()
        state = "#{alternate_on} #{cursor_flag} #{wrap_flag} #{keypad_flag}"
        assert self._tmux("display-message", "-p", state).strip() == "0 1 1 0"
        before, after = ((self._folder / name).read_text().splitlines()[1:] for name in ("before", "after"))
        assert after == before  # but for its first line, the size
        shown = self._tmux("capture-pane", "-p", "-J", "-S", "-")
        for word in words:
            assert word in shown, shown
        assert "Traceback" not in shown
        return shown
