# SPDX-License-Identifier: GPL-2.0-or-later
"""The capture tool as Wireshark has it: in a folder of an ordinary user, started by the real tshark."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
START = "from dalycapture.extcap import entry; entry()"


def as_user() -> list[str]:
    """Words that make a command an ordinary user's, where we are root."""
    return ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"] if os.geteuid() == 0 else []


def tool_words() -> list[str]:
    """How to start the tool so that an ordinary user may: root's own Python may be out of his reach."""
    try:
        # Through a shell: setpriv itself still has root's rights when it starts a program.
        command = [*as_user(), "sh", "-c", '"$1" -c ""', "sh", sys.executable]
        subprocess.run(command, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        paths = os.pathsep.join(str(ROOT / folder) for folder in ("capture", "tools"))
        return ["env", f"PYTHONPATH={paths}", "/usr/bin/python3", "-c", START]
    return [sys.executable, "-c", START]


@dataclass
class Home:
    """Somebody's home, with the tool where each version looks for it."""

    folder: Path

    def __post_init__(self) -> None:
        self.folder.chmod(0o755)
        for place in (".config/wireshark/extcap", ".local/lib/wireshark/extcap"):
            tool = self.folder / place / "dalyshark"
            tool.parent.mkdir(parents=True)
            tool.write_text(f'#!/bin/sh\nexec {shlex.join(tool_words())} "$@"\n', encoding="utf-8")
            tool.chmod(0o755)
        if os.geteuid() == 0:
            for path in (self.folder, *self.folder.rglob("*")):
                os.chown(path, 65534, 65534)

    def start(self, *words: str) -> subprocess.Popen[str]:
        """Start tshark as its owner."""
        environment = {"HOME": str(self.folder), "PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8"}
        return subprocess.Popen(
            [*as_user(), "tshark", *words],
            env=environment,
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, *words: str) -> tuple[int, str, str]:
        """Run tshark; (status, stdout, stderr). That it hangs fails the test."""
        process = self.start(*words)
        try:
            out, err = process.communicate(timeout=30)
        finally:
            process.kill()
        return process.returncode, out, err
