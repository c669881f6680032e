# SPDX-License-Identifier: GPL-2.0-or-later
"""The serial adapters of this machine, for people: by the name that stays the same. None is opened."""

from __future__ import annotations

import sys
from pathlib import Path

from dalycapture.adapters import Adapter, adapters
from dalytools.terminal_text import plain


def list_adapters() -> int:
    """Print them, one block each; exit status 0, or 1 where there is none."""
    found = adapters()
    if not found:
        print("No serial adapter on this machine: is it plugged in?", file=sys.stderr)  # noqa: T201
        return 1
    for adapter in found:
        print(described(adapter))  # noqa: T201
    return 0


def described(adapter: Adapter) -> str:
    """Lay out one adapter: the name to type, then what is known of it."""
    name, device = adapter.stable_name, adapter.device
    facts = [
        device if device != name else "",
        adapter.hardware,
        f"driver {adapter.driver}" if adapter.driver else "",
        f"USB {adapter.topology}" if adapter.topology else "",
        "" if adapter.latency_ms is None else f"latency timer {adapter.latency_ms:g} ms",
        "" if adapter.latency_ms is None or adapter.latency_ms <= 1 else "--low-latency makes times better",
        "" if "/" not in device or Path(device).exists() else "no device file",
    ]
    return f"{plain(name)}\n    {plain(', '.join(fact for fact in facts if fact)) or 'nothing more is known'}"
