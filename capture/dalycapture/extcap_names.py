# SPDX-License-Identifier: GPL-2.0-or-later
"""What the capture tool calls things when it talks with Wireshark: its interface, the controls of its toolbar."""

from __future__ import annotations

from typing import Final

INTERFACE: Final = "daly"  # any adapter, chosen by its option "port"

LOG, MARK_TEXT, MARK, HEARD = range(4)
"""Numbers of the controls in the toolbar."""

FILTERS: Final = (
    "A serial line has no capture filter: every byte is kept. Leave it empty, and use a display filter, such as "
    "daly.data_id == 0x90"
)
