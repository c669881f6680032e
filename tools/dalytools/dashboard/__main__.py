# SPDX-License-Identifier: GPL-2.0-or-later
"""Started by ``dalytools.dashboard.view``: packets on standard input, messages on the descriptor that is named."""

from __future__ import annotations

import os
import sys

from dalytools.dashboard.program import run

if __name__ == "__main__":
    # At once: the thread that waits for packets holds standard input, which the interpreter's own end would wait for.
    os._exit(run(sys.argv[1:]))
