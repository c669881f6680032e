# SPDX-License-Identifier: GPL-2.0-or-later
"""The dashboard's own process: packets and messages in, pictures out, until the packets end.

A thread reads and decodes; the main thread draws, four times a second and when a key was pressed.
"""

from __future__ import annotations

import contextlib
import copy
import os
import signal
import socket
import sys
import threading
import time
from typing import TYPE_CHECKING, Final

from dalycapture.errors import CaptureError, TruncatedError
from dalycapture.reader import read_capture
from dalyref.decoder import Decoder
from dalyref.options import Options
from dalytools.dashboard.glyphs import glyphs_for
from dalytools.dashboard.layout import View, screen_lines
from dalytools.dashboard.screen import Screen
from dalytools.dashboard.state import State
from dalytools.dashboard.status import LARGEST, Key, Status, unpack

if TYPE_CHECKING:
    from collections.abc import Sequence

DRAW_S: Final = 0.25
_BETWEEN_S: Final = 0.08  # two pictures, however fast keys come


class Program:
    """What is known, and what was pressed."""

    def __init__(self, options: Options) -> None:
        self.state = State(reply_s=options.reply)
        self.status = Status()
        self.problem = ""
        self.ended = threading.Event()
        self._lock = threading.Lock()
        self._decoder = Decoder(options, early=lambda record: self.state.early(record, time.monotonic()))
        self._selected = ""
        self._frozen: tuple[State, float] | None = None

    def read(self) -> None:
        """Take packets from standard input to their end; ``problem`` says what was wrong with them."""
        try:
            for packet in read_capture("-"):
                with self._lock:
                    for record in self._decoder.feed(packet):
                        self.state.final(record)
        except TruncatedError:  # the capture ended all at once
            pass
        except CaptureError as error:
            self.problem = str(error)
        except Exception as error:  # it must be said, and the screen put away
            self.problem = f"{type(error).__name__}: {error}"
        finally:
            self.ended.set()

    def take(self, message: Status | Key) -> None:
        """Take a message from the capture."""
        if isinstance(message, Status):
            self.status = message
            return
        with self._lock:
            names = self.state.names()
            if message.name == "p":
                self._frozen = None if self._frozen else (copy.deepcopy(self.state), time.monotonic())
            elif message.name in names:
                self._selected = message.name
            elif names and message.name in {"\t", "right", "left"}:
                at = names.index(self._selected) if self._selected in names else 0
                self._selected = names[(at + (-1 if message.name == "left" else 1)) % len(names)]

    def draw(self, screen: Screen) -> None:
        """Show what is known now, or what was known when it was paused."""
        now = time.monotonic()
        width, height = screen.size
        with self._lock:
            state, at, paused_s = self.state, now, None
            if self._frozen:
                state, at = self._frozen
                paused_s = now - at
            names = state.names()
            if self._selected not in names and names:
                self._selected = names[0]
            view = View(state, self.status, self._selected, at, paused_s)
            lines = screen_lines(view, width, height, glyphs_for(os.environ))
        screen.draw(lines)


def run(words: Sequence[str]) -> int:
    """Draw until the packets end. words: descriptor of the messages, baud rate. Status 1: with a problem, on stderr."""
    # Ctrl-C is for the capture, whose end is ours; and we write though the terminal is the capture's.
    for name in ("SIGINT", "SIGQUIT", "SIGTSTP", "SIGTTOU"):
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    program = Program(Options(baud=int(words[1])))
    problem = ""
    try:
        with socket.socket(fileno=int(words[0])) as messages, Screen(sys.stdout.fileno()) as screen:
            threading.Thread(target=program.read, name="packets", daemon=True).start()
            _draw(program, messages, screen)
    except BrokenPipeError:
        problem = "the terminal is gone"
    except OSError as error:
        problem = f"the terminal: {error.strerror or error}"
    except Exception as error:  # in a line, where the capture can tell it
        problem = f"{type(error).__name__}: {error}"
    problem = problem or program.problem
    if problem:
        with contextlib.suppress(OSError):
            print(problem, file=sys.stderr, flush=True)  # noqa: T201 - for the capture
    return 1 if problem else 0


def _draw(program: Program, messages: socket.socket, screen: Screen) -> None:
    due = 0.0
    drawn_at = 0.0
    while not program.ended.is_set():
        now = time.monotonic()
        if now >= due:
            program.draw(screen)
            drawn_at = time.monotonic()
            due = drawn_at + DRAW_S
        messages.settimeout(max(0.001, min(due - time.monotonic(), 0.1)))
        try:
            data = messages.recv(LARGEST)
        except TimeoutError:
            continue
        if not data:
            program.ended.wait(DRAW_S)  # the capture is gone; its packets end too
            continue
        message = unpack(data)
        program.take(message)
        if isinstance(message, Key):
            due = drawn_at + _BETWEEN_S
