# SPDX-License-Identifier: GPL-2.0-or-later
"""From the packets of a capture to what the reference decoder is fed: the layers around Daly's bytes, by link type."""
