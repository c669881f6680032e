# SPDX-License-Identifier: GPL-2.0-or-later
"""``install``, ``uninstall``, ``doctor``: into the folders of the real tshark, with a home of its own."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from dalytools import cli
from dalytools.bundle import NAME, bundle
from dalytools.extcap_wrapper import answers, wrapper, wrapper_name
from dalytools.field_names import FIELD_NAMES
from dalytools.installation import PROFILE, RECORD, Done, Installation, Step
from dalytools.tshark import dissector_folder, find_tshark
from dalytools.wireshark_folders import WiresharkFolders, extcap_folder, wireshark_folders

if TYPE_CHECKING:
    from collections.abc import Iterator

SAMPLE = Path(__file__).resolve().parents[3] / "pcap_samples" / "real-poll-cycle.pcapng"


@pytest.fixture
def home(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A home that an ordinary user can read, whoever runs the tests."""
    with tempfile.TemporaryDirectory(prefix="dalyshark-test-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        monkeypatch.setenv("HOME", name)
        monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
        yield folder


def folders(home: Path) -> WiresharkFolders:
    return WiresharkFolders("tshark", "4.0.17", True, home / "plugins", home / "profiles", home / "extcap")


def steps(done: list[Done]) -> list[Step]:
    return [each.step for each in done]


def as_user(home: Path, *arguments: str) -> str:
    """What tshark prints for an ordinary user with this home."""
    for path in (home, *home.rglob("*")):
        path.chmod(0o755 if path.is_dir() or os.access(path, os.X_OK) else 0o644)
    words = [find_tshark(), "-n", *arguments]
    if os.geteuid() == 0:
        words = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", *words]
    environment = {"HOME": str(home), "PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8"}
    done = subprocess.run(words, capture_output=True, env=environment, cwd="/", check=True)
    assert b"Lua" not in done.stderr, done.stderr
    return done.stdout.decode()


@pytest.mark.parametrize(
    ("version", "folder"),
    [
        ("4.0.17", ".config/wireshark/extcap"),
        ("4.2.0", ".local/lib/wireshark/extcap"),
        ("4.4.18", ".local/lib/wireshark/extcap"),
        ("4.6.9", ".local/lib/wireshark/extcap"),
    ],
)
def test_where_each_version_looks_for_capture_tools(version: str, folder: str, tmp_path: Path) -> None:
    """The release notes of 4.1.0: beside the plugins from then on."""
    configuration, plugins = tmp_path / ".config/wireshark", tmp_path / ".local/lib/wireshark/plugins"
    assert extcap_folder(version, configuration, plugins) == tmp_path / folder


def test_the_capture_tool_works_and_is_mended(home: Path) -> None:
    """As Wireshark starts it; a tool that may not be run, or is older than this, is made anew."""
    installation = Installation(wireshark_folders())
    installation.install()
    tool = installation.tool
    assert answers(tool)[0]
    tool.chmod(0o644)
    assert not answers(tool)[0]
    assert next(each.step for each in installation.state() if each.path == tool) is Step.REPLACE
    installation.install()
    assert answers(tool)[0]
    tool.write_bytes(b"#!/bin/sh\nexit 3\n")
    assert answers(tool) == (False, f"{tool} does not answer (it says nothing); to mend it: dalyshark install")


def test_the_capture_tool_of_a_path_with_spaces(tmp_path: Path) -> None:
    python = tmp_path / "a folder's" / "python"
    python.parent.mkdir()
    python.symlink_to(sys.executable)
    tool = tmp_path / "dalyshark"
    tool.write_bytes(wrapper(str(python), "posix"))
    tool.chmod(0o755)
    done = subprocess.run(["sh", "-n", tool], capture_output=True, check=True)
    assert done.stderr == b""
    assert subprocess.run([tool, "--version"], capture_output=True, check=False).returncode != 127


def test_the_capture_tool_of_windows() -> None:
    r"""Laid out by hand; cmd passes the words on with %*."""
    assert wrapper_name("nt") == "dalyshark.bat"
    assert wrapper(r"C:\Program Files\Python\python.exe", "nt") == (
        b"@echo off\r\n"
        b"rem dalyshark's capture tool for Wireshark\r\n"
        b'"C:\\Program Files\\Python\\python.exe" -c "from dalycapture.extcap import entry; entry()" %*\r\n'
    )


def test_the_real_tsharks_folders(home: Path) -> None:
    found = wireshark_folders()
    assert found.extcap in {home / ".config/wireshark/extcap", home / ".local/lib/wireshark/extcap"}
    assert found.plugins == home / ".local/lib/wireshark/plugins"
    assert found.profiles == home / ".config/wireshark/profiles"
    assert found.lua
    assert found.version.count(".") == 2


def test_install_and_uninstall(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(home.rglob("*"))
    assert cli.main(["install", "--dry-run"]) == 0
    assert "would write" in capsys.readouterr().out
    assert sorted(home.rglob("*")) == before
    done = Installation(wireshark_folders()).install()
    assert set(steps(done)) == {Step.WRITE}
    columns = as_user(home, "-C", PROFILE, "-r", str(SAMPLE))
    assert "52.8" in columns.splitlines()[1]  # a column of the profile, filled by the plugin
    assert set(steps(Installation(wireshark_folders()).install())) == {Step.SAME}
    assert cli.main(["uninstall"]) == 0
    assert [path for path in home.rglob("*") if path.is_file()] == []
    assert cli.main(["uninstall"]) == 0
    assert "nothing is installed" in capsys.readouterr().out


def test_a_changed_file_is_asked_for(tmp_path: Path) -> None:
    there = folders(tmp_path)
    Installation(there).install()
    colours = there.profiles / PROFILE / "colorfilters"
    colours.write_text("# mine\n")
    asked: list[str] = []

    def answer(question: str) -> bool:
        asked.append(question)
        return False

    assert Step.KEEP in steps(Installation(there, ask=answer).install())
    assert colours.read_text() == "# mine\n"
    assert "changed since" in asked[0]
    assert Step.KEEP in steps(Installation(there, ask=answer).uninstall())
    assert colours.exists()
    assert not (there.plugins / NAME).exists()
    assert Step.REPLACE in steps(Installation(there, ask=lambda _: True).install())
    assert colours.read_text() != "# mine\n"


def test_an_older_version_of_ours_is_replaced_without_a_word(tmp_path: Path) -> None:
    there = folders(tmp_path)
    Installation(there).install()
    plugin, record = there.plugins / NAME, there.profiles / PROFILE / RECORD
    plugin.write_text("-- older\n")
    told = json.loads(record.read_text())
    told[str(plugin)] = "03a6b1f0b3a3"  # not its sum
    record.write_text(json.dumps(told))
    assert Step.KEEP in steps(Installation(there).install())
    told[str(plugin)] = hashlib.sha256(b"-- older\n").hexdigest()
    record.write_text(json.dumps(told))
    assert Step.REPLACE in steps(Installation(there).install())
    assert plugin.read_text() == bundle(dissector_folder())


def test_another_ones_file_and_links_are_left(tmp_path: Path) -> None:
    there = folders(tmp_path)
    there.plugins.mkdir()
    outside = tmp_path / "outside.lua"
    outside.write_text("-- theirs\n")
    (there.plugins / NAME).symlink_to(outside)
    assert Step.LEAVE in steps(Installation(there, ask=lambda _: True).install())
    assert outside.read_text() == "-- theirs\n"


def test_a_forged_record_reaches_no_other_folder(tmp_path: Path) -> None:
    there = folders(tmp_path)
    Installation(there).install()
    victim = tmp_path / "victim"
    victim.write_text("x")
    record = there.profiles / PROFILE / RECORD
    forged = {str(victim): hashlib.sha256(b"x").hexdigest()}
    record.write_text(json.dumps(forged))
    Installation(there, ask=lambda _: True).uninstall()
    assert victim.exists()


@pytest.mark.parametrize("text", ["", "[]", "{", '{"a": 1}', "\x00"])
def test_a_broken_record_is_no_record(tmp_path: Path, text: str) -> None:
    there = folders(tmp_path)
    record = there.profiles / PROFILE / RECORD
    record.parent.mkdir(parents=True)
    record.write_text(text)
    assert Step.WRITE in steps(Installation(there).install())


def test_doctor(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["doctor"]) == 1
    assert "!!  plugin" in capsys.readouterr().out
    Installation(wireshark_folders()).install()
    (home / ".local/lib/wireshark/plugins/daly.lua").write_text("-- older\n")
    cli.main(["doctor", "--json"])
    findings = {each["what"]: each for each in json.loads(capsys.readouterr().out)}
    assert findings["plugin"]["ok"]
    assert findings["profile"]["ok"]
    assert findings["dissector"]["ok"]
    assert "daly.lua" in findings["plugin, double"]["said"]


def test_without_wireshark(home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("DALYSHARK_TSHARK", "no-such-program")
    assert cli.main(["doctor"]) == 1
    assert "!!  Wireshark" in capsys.readouterr().out


def test_the_bundle_is_the_dissector(home: Path) -> None:
    """Given twice (personal folder and -X), from a folder without the modules: loaded once, the same values."""
    Installation(wireshark_folders()).install()
    words = ["-r", str(SAMPLE), "-T", "fields", "-e", "daly.pack.voltage", "-e", "daly.cells.spread"]
    once = as_user(home, *words)
    assert "52.8" in once
    assert as_user(home, "-X", f"lua_script:{home}/.local/lib/wireshark/plugins/{NAME}", *words) == once


def test_every_field_of_the_profile_is_one_of_ours() -> None:
    for file in (dissector_folder() / "profile").iterdir():
        lines = [line for line in file.read_text().splitlines() if not line.startswith("#")]
        named = set(re.findall(r"daly\.[a-z_0-9.]*[a-z0-9]", "\n".join(lines)))
        assert named <= set(FIELD_NAMES), file.name
        assert named or file.name == "profile_settings"
