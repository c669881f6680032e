# SPDX-License-Identifier: GPL-2.0-or-later
"""The reference decoder: bytes to values, by the vendor's papers. Pure Python, standard library only, no I/O."""
