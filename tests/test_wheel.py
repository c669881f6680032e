# SPDX-License-Identifier: GPL-2.0-or-later
"""The wheel: built, installed into an empty virtual environment, used far from the repository, without a network."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

TOP = Path(__file__).parents[1]
DEPENDENCIES = ("rich", "pygments", "markdown_it", "mdurl", "serial")
"""What pip would fetch: those of pyproject.toml, and rich's own."""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    words = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(TOP)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (path,) = folder.iterdir()
    return path


@pytest.fixture(scope="module")
def program(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """``dalyshark`` as installed."""
    home = tmp_path_factory.mktemp("home")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(home / "venv")], check=True)
    python = home / "venv" / "bin" / "python"
    install = ["--quiet", "install", "--no-deps", "--no-index", "--disable-pip-version-check", str(wheel)]
    subprocess.run([sys.executable, "-m", "pip", "--python", str(python), *install], check=True)
    beside = home / "dependencies"
    beside.mkdir()
    for name in DEPENDENCIES:
        spec = find_spec(name)
        assert spec is not None
        assert spec.origin is not None
        (beside / name).symlink_to(Path(spec.origin).parent)
    (packages,) = (home / "venv" / "lib").glob("python*/site-packages")
    (packages / "dependencies.pth").write_text(f"{beside}\n", encoding="utf-8")
    return home / "venv" / "bin" / "dalyshark"


def run(program: Path, *words: object) -> str:
    """What it prints; nothing of this environment or the repository in its way."""
    folder = program.parents[2]
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL"))}
    done = subprocess.run(
        [str(program), *map(str, words)], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    assert str(TOP) not in done.stdout.replace(str(folder), "")
    return done.stdout


def test_what_is_in_it(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    lua = {path.name for path in (TOP / "dissector").glob("*.lua")}
    assert {name.rpartition("/")[2] for name in names if name.startswith("dalytools/dissector/")} >= lua
    assert "dalytools/samples/real-poll-cycle.pcapng" in names
    assert {name.partition("/")[0] for name in names} == {
        "dalycapture",
        "dalyref",
        "dalytools",
        "dalyshark-0.1.0.dist-info",
    }
    assert not [name for name in names if "__pycache__" in name]
    assert "dalyshark-0.1.0.dist-info/licenses/LICENSE" in names


def test_version(program: Path) -> None:
    assert run(program, "--version") == "dalyshark 0.1.0\n"


def test_decode(program: Path) -> None:
    shown = run(program, "decode", sample(program)).splitlines()
    assert len(shown) == 25
    assert "52.8 V" in shown[1]


def test_check(program: Path) -> None:
    shown = run(program, "check", sample(program)).splitlines()
    # 14 cells, and a slot 15 that holds 3780 mV: a note of check's
    assert shown[0].endswith("real-poll-cycle.pcapng: 25 records (25 frame): 0 differences, 1 note")


def test_watch(program: Path) -> None:
    """The real session is played, with the dissector of the installed package, and all is where it is said to be."""
    shown = run(program, "watch", "--duration", 3)
    assert "First a real session is played back" in shown
    assert "Reply board 1  0x90 Pack: 52.8 V  0.0 A  SOC 50.0 %" in shown
    assert "records: 0 differences\n" in shown
    opens = next(line for line in shown.splitlines() if line.startswith("Open it:"))
    lua, capture = opens.partition("lua_script:")[2].split()
    assert Path(lua).is_file()
    assert str(program.parents[1]) in lua
    assert (program.parents[2] / capture).is_file()


def sample(program: Path) -> Path:
    (path,) = program.parents[1].glob("lib/python*/site-packages/dalytools/samples/real-poll-cycle.pcapng")
    return path
