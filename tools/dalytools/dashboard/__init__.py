# SPDX-License-Identifier: GPL-2.0-or-later
"""The screen of ``dalyshark watch --dashboard``: a program of its own that only looks on.

    capture --packets--> pipe --> decoder --> state --panels, layout--> screen
            --keys, how the capture goes----> (a message each)

The capture never waits for it: what the pipe does not take waits, and is dropped at last, from the view alone. When
the screen breaks, hangs or is killed, the capture goes on and the terminal is put right (``view``).
"""
