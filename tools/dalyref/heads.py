# SPDX-License-Identifier: GPL-2.0-or-later
"""Where a window can begin: the first bytes of each, as patterns."""

from __future__ import annotations

import re

_A5 = rb"\xa5(?:..\x08|.?.?\Z)"
_REPLY = rb"[\xd2\x51-\x60]"
_REQUEST = rb"[\x81-\x90]"
_MODBUS = _REPLY + rb"[\x03\x06\x10\x83\x86\x90]|" + _REQUEST + rb"[\x03\x06\x10]"

WHOLE = re.compile(_A5 + rb"|" + _MODBUS, re.DOTALL)
"""An ``A5 . . 08``, or the beginning of one cut off by the end of the search; address and function of Modbus."""

ANY = re.compile(WHOLE.pattern + rb"|" + _REPLY + rb"\Z|" + _REQUEST + rb"\Z", re.DOTALL)
"""The same, and an address alone at the end of the search."""
