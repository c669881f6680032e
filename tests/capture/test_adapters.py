# SPDX-License-Identifier: GPL-2.0-or-later
"""Adapters, read from a made sysfs laid out as the kernel's (Documentation/ABI, usb-serial)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from dalycapture.adapters import Adapter, adapter_of, adapters, find_again
from dalytools.adapter_list import described

if TYPE_CHECKING:
    from pathlib import Path

FTDI = "FTDI FT232R USB UART (0403:6001)"
CH340 = "USB Serial (1a86:7523)"


class Machine:
    """A machine with USB sockets, and udev's links."""

    def __init__(self, root: Path) -> None:
        self.sys, self.dev = root / "sys", root / "dev"
        (self.sys / "class/tty").mkdir(parents=True)
        self.dev.mkdir()
        self.uart("ttyS0", "16550A")

    def uart(self, name: str, kind: str) -> None:
        port = self.sys / "devices/platform/serial8250" / name
        port.mkdir(parents=True)
        driver = self.sys / "bus/platform/drivers/serial8250"
        driver.mkdir(parents=True, exist_ok=True)
        (port / "driver").symlink_to(driver)
        self._tty(name, port)
        (self.sys / "class/tty" / name / "type").write_text("0" if kind == "none" else "4")

    def _tty(self, name: str, port: Path) -> None:
        entry = self.sys / "class/tty" / name
        entry.mkdir()
        (entry / "device").symlink_to(port)
        (self.dev / name).write_text("")

    def plug(self, name: str, topology: str, driver: str, by_id: str = "", latency: str = "") -> None:
        place, _, _ = topology.partition(":")
        usb = self.sys / "devices/usb1" / place
        port = usb / topology / name
        port.mkdir(parents=True)
        texts = (
            ("FTDI", "FT232R USB UART", "0403", "6001") if driver == "ftdi_sio" else ("", "USB Serial", "1a86", "7523")
        )
        for key, text in zip(("manufacturer", "product", "idVendor", "idProduct"), texts, strict=True):
            if text:
                (usb / key).write_text(text + "\n")
        (self.sys / "bus/usb-serial/drivers" / driver).mkdir(parents=True, exist_ok=True)
        (port / "driver").symlink_to(self.sys / "bus/usb-serial/drivers" / driver)
        if latency:
            (port / "latency_timer").write_text(latency + "\n")
        self._tty(name, port)
        devices = self.sys / "bus/usb/devices"
        devices.mkdir(parents=True, exist_ok=True)
        (devices / topology).symlink_to(usb / topology)
        if by_id:
            links = self.dev / "serial/by-id"
            links.mkdir(parents=True, exist_ok=True)
            (links / by_id).symlink_to(f"../../{name}")

    def unplug(self, name: str, topology: str, by_id: str = "") -> None:
        import shutil

        shutil.rmtree(self.sys / "devices/usb1" / topology.partition(":")[0])
        (self.sys / "class/tty" / name / "device").unlink()
        (self.sys / "class/tty" / name).rmdir()
        (self.sys / "bus/usb/devices" / topology).unlink()
        (self.dev / name).unlink()
        if by_id:
            (self.dev / "serial/by-id" / by_id).unlink()


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    made = Machine(tmp_path)
    made.uart("ttyS1", "none")  # a place for a UART, and none there
    made.plug("ttyUSB10", "1-1.2:1.0", "ch341-uart")
    made.plug("ttyUSB2", "1-2:1.0", "ftdi_sio", by_id="usb-FTDI_FT232R_A50285BI-if00-port0", latency="16")
    return made


def listed(machine: Machine) -> list[Adapter]:
    return adapters(machine.sys, machine.dev)


def test_all_that_the_kernel_says(machine: Machine) -> None:
    dev = machine.dev
    assert listed(machine) == [
        Adapter(f"{dev}/ttyS0", driver="serial8250"),
        Adapter(
            f"{dev}/ttyUSB2",
            by_id=f"{dev}/serial/by-id/usb-FTDI_FT232R_A50285BI-if00-port0",
            topology="1-2:1.0",
            hardware=FTDI,
            driver="ftdi_sio",
            latency_ms=16.0,
        ),
        Adapter(f"{dev}/ttyUSB10", topology="1-1.2:1.0", hardware=CH340, driver="ch341-uart"),
    ]


def test_one_adapter_by_its_link(machine: Machine) -> None:
    link = machine.dev / "serial/by-id/usb-FTDI_FT232R_A50285BI-if00-port0"
    assert adapter_of(str(link), machine.sys, machine.dev) == listed(machine)[1]
    assert adapter_of("/dev/none", machine.sys, machine.dev) == Adapter("/dev/none")


def test_nothing_is_opened(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    for node in machine.dev.glob("tty*"):
        node.unlink()
        node.symlink_to("/nowhere")  # opening it would fail
    assert len(listed(machine)) == 3


def test_the_same_adapter_is_found_again_under_another_number(machine: Machine) -> None:
    by_id = "usb-FTDI_FT232R_A50285BI-if00-port0"
    _, ftdi, _ = listed(machine)

    def again() -> str | None:
        return find_again(ftdi.device, ftdi, machine.sys, machine.dev)

    assert again() == ftdi.by_id
    machine.unplug("ttyUSB2", "1-2:1.0", by_id)
    assert again() is None
    machine.plug("ttyUSB2", "1-2:1.0", "ch341-uart")  # another adapter took its number and its socket
    assert again() is None
    machine.plug("ttyUSB3", "1-3:1.0", "ftdi_sio", by_id=by_id)  # it came back in another socket
    assert again() == ftdi.by_id


def test_one_without_a_name_is_known_by_its_place(machine: Machine) -> None:
    ch340 = listed(machine)[2]

    def again() -> str | None:
        return find_again(ch340.device, ch340, machine.sys, machine.dev)

    machine.unplug("ttyUSB10", "1-1.2:1.0")
    assert again() is None
    machine.plug("ttyUSB10", "1-4:1.0", "ch341-uart")  # its number, another place: not known to be the same
    assert again() is None
    machine.plug("ttyUSB11", "1-1.2:1.0", "ch341-uart")
    assert again() == f"{machine.dev}/ttyUSB11"


def test_without_any_identity_the_name_decides(tmp_path: Path) -> None:
    name = tmp_path / "port"
    assert find_again(str(name), Adapter(str(name))) is None
    name.write_text("")
    assert find_again(str(name), Adapter(str(name))) == str(name)


def test_for_people(machine: Machine) -> None:
    _, ftdi, ch340 = listed(machine)
    timer = "latency timer 16 ms, --low-latency makes times better"
    assert described(ftdi).splitlines() == [
        f"{machine.dev}/serial/by-id/usb-FTDI_FT232R_A50285BI-if00-port0",
        f"    {machine.dev}/ttyUSB2, {FTDI}, driver ftdi_sio, USB 1-2:1.0, {timer}",
    ]
    assert described(ch340).splitlines()[0] == f"{machine.dev}/ttyUSB10"


def test_a_name_can_not_steer_the_terminal() -> None:
    assert "\x1b" not in described(Adapter("/dev/x\x1b[2J", hardware="\x1b]0;x"))
