# SPDX-License-Identifier: GPL-2.0-or-later
"""A command of a page, as a reader would type it: by a shell, with the program of this Python in its path."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def shell(text: str, folder: Path) -> str:
    """Run it in a folder; what it printed. It must end well and complain of nothing."""
    done = subprocess.run(
        ["/bin/sh", "-c", text],
        cwd=folder,
        env={**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, ""), text
    return done.stdout
