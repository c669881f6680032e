# SPDX-License-Identifier: GPL-2.0-or-later
"""Serial adapters, as the system lists them. No port is opened to find out.

On Linux all is read from the kernel's tables, ``/sys/class/tty``, and the links that udev makes of what stays::

    /dev/ttyUSB0                                        the next free number, another one after each plugging
    /dev/serial/by-id/usb-FTDI_FT232R_A50285BI-if00-port0   the adapter itself, where it has a serial number
    /dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0  the socket it is plugged into
    1-2:1.0                                             the same place, as the kernel calls it (topology)

Elsewhere pyserial lists them.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

SYS: Final = Path("/sys")
DEV: Final = Path("/dev")

_TOPOLOGY = re.compile(r"\d+-\d+(\.\d+)*:\d+\.\d+")


@dataclass(frozen=True, slots=True)
class Adapter:
    """A serial port with hardware behind it. What is not known is empty, or None."""

    device: str  # /dev/ttyUSB0, COM5
    by_id: str = ""  # link that names the adapter
    by_path: str = ""  # link that names its place
    topology: str = ""  # USB: bus-port.port:configuration.interface
    hardware: str = ""  # what a USB adapter calls itself, without its serial number
    driver: str = ""
    latency_ms: float | None = None  # latency timer

    @property
    def stable_name(self) -> str:
        """The name that stays: by-id, else by-path, else the device."""
        return self.by_id or self.by_path or self.device

    @property
    def identity(self) -> tuple[str, str]:
        """What makes it the same adapter when it comes back: (its own name, or its place)."""
        return self.by_id, self.topology


def adapters(sys_folder: Path = SYS, dev_folder: Path = DEV) -> list[Adapter]:
    """List the serial adapters of this machine, by name of device; none is opened."""
    if not (sys_folder / "class/tty").is_dir():
        return _listed_by_pyserial()
    by_id, by_path = (_links(dev_folder / "serial" / kind) for kind in ("by-id", "by-path"))
    found: list[Adapter] = []
    for entry in sorted((sys_folder / "class/tty").iterdir(), key=lambda entry: _by_number(entry.name)):
        if not (entry / "device" / "driver").exists():
            continue
        if _line(entry / "type") == "0":  # a place for a UART, and none there
            continue
        adapter = _described(entry, f"{dev_folder}/{entry.name}")
        links = {"by_id": by_id.get(entry.name, ""), "by_path": by_path.get(entry.name, "")}
        found.append(replace(adapter, **links))
    return found


def adapter_of(name: str, sys_folder: Path = SYS, dev_folder: Path = DEV) -> Adapter:
    """Tell what is known of the adapter behind this device or link; only its name where nothing is."""
    device = os.path.realpath(name)
    entry = sys_folder / "class/tty" / Path(device).name
    if not (entry / "device").exists():
        return Adapter(name)
    by_id, by_path = (_links(dev_folder / "serial" / kind).get(Path(device).name, "") for kind in ("by-id", "by-path"))
    return replace(_described(entry, device), by_id=by_id, by_path=by_path)


def find_again(name: str, before: Adapter, sys_folder: Path = SYS, dev_folder: Path = DEV) -> str | None:
    """Find the device to open now for an adapter that went away; None: it is not back.

    name: what the user typed. Where the adapter has a name of its own or a place that is known, only that one is taken:
    another adapter may have got its number. Without either the name alone decides.
    """
    if not before.by_id and not before.topology:
        return name if os.path.exists(name) else None  # noqa: PTH110 - called 40 times a second
    if before.by_id:
        if os.path.exists(before.by_id):  # noqa: PTH110
            return before.by_id
        if (dev_folder / "serial/by-id").is_dir():
            return None  # udev is there and does not know it yet
    if not (sys_folder / "bus/usb/devices" / before.topology).exists():
        return None
    for adapter in adapters(sys_folder, dev_folder):
        if adapter.topology == before.topology and adapter.hardware == before.hardware:
            return adapter.device if os.path.exists(adapter.device) else None  # noqa: PTH110
    return None


def serial_ports() -> list[str]:
    """List the devices of all adapters; none is opened."""
    return [adapter.device for adapter in adapters()]


def _described(entry: Path, device: str) -> Adapter:
    """Read what sysfs says of a tty."""
    hardware = topology = ""
    latency = None
    with contextlib.suppress(OSError):
        folder = (entry / "device").resolve(strict=True)
        for level in (folder, *folder.parents[:3]):
            if not topology and _TOPOLOGY.fullmatch(level.name):
                topology = level.name
            if (level / "idVendor").exists():
                keys = ("manufacturer", "product", "idVendor", "idProduct")
                maker, product, vendor, model = (_line(level / key) for key in keys)
                hardware = f"{maker} {product} ({vendor}:{model})".strip()
                break
        with contextlib.suppress(ValueError):
            latency = float(_line(folder / "latency_timer"))
    driver = entry / "device" / "driver"
    return Adapter(
        device,
        topology=topology,
        hardware=hardware,
        driver=driver.resolve().name if driver.exists() else "",
        latency_ms=latency,
    )


def _links(folder: Path) -> dict[str, str]:
    """Map the name of each device to the link in this folder that leads to it."""
    found: dict[str, str] = {}
    with contextlib.suppress(OSError):
        for link in sorted(folder.iterdir()):
            if link.is_symlink():
                found[link.readlink().name] = str(link)
    return found


def _line(path: Path) -> str:
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    return "".join(letter for letter in text if letter.isprintable())[:80].strip()


def _by_number(name: str) -> tuple[str, int]:
    letters = name.rstrip("0123456789")
    return letters, int(name[len(letters) :] or 0)


def _listed_by_pyserial() -> list[Adapter]:
    """MacOS and Windows: the system's own lists, through pyserial."""
    if sys.platform.startswith("linux"):  # no sysfs: a container, or a jail
        return []
    from serial.tools import list_ports

    found: list[Adapter] = []
    for port in list_ports.comports():
        ids = "" if port.vid is None else f" ({port.vid:04x}:{port.pid:04x})"
        found.append(Adapter(port.device, topology=port.location or "", hardware=f"{port.description}{ids}"))
    return sorted(found, key=lambda adapter: _by_number(adapter.device))
