# SPDX-License-Identifier: GPL-2.0-or-later
"""Temperatures that are none: bytes 00 and FF stand where no sensor is (field notes, a.92; docs/records.md, 8)."""

from __future__ import annotations

from typing import Final

NO_SENSOR: Final = frozenset((-40, 215))
"""C."""
