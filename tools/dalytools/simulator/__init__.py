# SPDX-License-Identifier: GPL-2.0-or-later
"""A simulated bus: boards and a polling host that behave as real devices do, in virtual time or on pseudo-terminals.

It builds its frames by itself and shares no code with the reference decoder or the dissector: traffic made here
is a third opinion on the protocol, not an echo of the reading it is used to test.
"""
