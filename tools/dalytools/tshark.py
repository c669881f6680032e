# SPDX-License-Identifier: GPL-2.0-or-later
"""Start the real tshark with our dissector, so that it surely loads and nothing of the user's gets in its way.

Three traps stand behind this file:

- from 4.2 on, a tshark that runs as root ignores Lua plugins without a word: as root we start it as an ordinary user,
  with the dissector (and, where needed, the capture) in a folder that this user can read;
- tshark's exit status says nothing about Lua: its messages are read for ``Lua:``, and a first run on two known packets
  proves that the dissector is there;
- a copy of the dissector in the user's plugin folder, or preferences, would change what is compared: HOME and
  Wireshark's folders point to an empty folder.

``DALYSHARK_TSHARK`` names another tshark than the one on the PATH.
"""

from __future__ import annotations

import os
import shutil
import stat
import struct
import subprocess
import tempfile
from importlib import resources
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Self

from dalytools.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from types import TracebackType

ORDINARY_USER = 65534  # nobody
_OPEN_PLACE = "/tmp"  # noqa: S108 - a new folder of its own in it, where TMPDIR is root's alone

_PLACES = (  # where installers put it without telling the PATH
    r"C:\Program Files\Wireshark\tshark.exe",
    "/Applications/Wireshark.app/Contents/MacOS/tshark",
)

_MISSING = (
    "tshark, Wireshark's terminal program, is not installed; "
    "on Debian and Ubuntu: sudo apt install tshark (others: wireshark.org)"
)

# A request and its reply, as a classic pcap of link type 147: what the dissector must know.
_PROOF = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 147) + b"".join(
    struct.pack("<IIII", 0, 0, 13, 13) + bytes.fromhex(frame)
    for frame in ("a540900800000000000000007d", "a501900802100000753001f4ea")
)


def dissector_folder() -> Path:
    """Return the folder with daly.lua: inside an installed package, else the repository's."""
    packaged = Path(str(resources.files("dalytools"))) / "dissector"
    if packaged.is_dir():
        return packaged
    return Path(__file__).resolve().parents[2] / "dissector"


def find_tshark() -> str:
    """Return the path of tshark. Raises Problem when there is none."""
    asked = os.environ.get("DALYSHARK_TSHARK")
    if asked:
        program = shutil.which(asked)
        if program is None:
            raise Problem(f"DALYSHARK_TSHARK is {asked}, which is not a program; name another, or unset it")
        return str(Path(program).absolute())
    found = shutil.which("tshark") or next((place for place in _PLACES if Path(place).exists()), None)
    if found is None:
        raise Problem(_MISSING)
    return found


class Tshark:
    """A tshark with our dissector. Use as a context manager: it keeps a temporary folder.

    version: as tshark says it, for example ``"4.0.17"``. Raises Problem when there is no tshark or the dissector does
    not load in it.
    """

    def __init__(self) -> None:
        self._program = find_tshark()
        self._as_root = hasattr(os, "geteuid") and os.geteuid() == 0
        place = _OPEN_PLACE if self._as_root and not _anyone_enters(Path(tempfile.gettempdir())) else None
        self._folder = tempfile.TemporaryDirectory(prefix="dalyshark-", dir=place, ignore_cleanup_errors=True)
        self._home = Path(self._folder.name)
        self.version = ""

    def __enter__(self) -> Self:
        try:
            self._prepare()
        except BaseException:
            self._folder.cleanup()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._folder.cleanup()

    @property
    def home(self) -> Path:
        """The temporary folder, which the tshark that is started can read and write."""
        return self._home

    def readable(self, path: Path) -> Path:
        """Return a path of this file that the tshark which is started can read: a copy where it must be."""
        if not self._as_root:
            return path
        if _anyone_reads(path):
            return path.resolve()  # the way there, from here or through links, need not be open to all
        copy = self._home / f"{len(list(self._home.iterdir()))}-{path.name}"
        try:
            shutil.copyfile(path, copy)
        except OSError as error:
            raise Problem(f"{path}: cannot be copied for tshark to {self._home}: {error.strerror}") from None
        copy.chmod(0o644)
        return copy

    def command(self, *arguments: str) -> list[str]:
        """Return the words of a tshark call with our dissector: no name look-ups, the given arguments behind."""
        return [self._program, "-n", "-X", f"lua_script:{self._lua}", *arguments]

    def start(self, arguments: Sequence[str], **streams: Any) -> subprocess.Popen[bytes]:
        """Start tshark with these arguments; streams: stdin, stdout, stderr and the like, as for Popen."""
        return self._start(self.command(*arguments), **streams)

    @property
    def program(self) -> str:
        """Path of this tshark."""
        return self._program

    def start_program(
        self, words: Sequence[str], *, environment: Mapping[str, str] | None = None, **streams: Any
    ) -> subprocess.Popen[bytes]:
        """Start any program as this tshark is started: as an ordinary user, away from the user's own settings.

        environment: what is set otherwise for it.
        """
        surroundings = self._surroundings()
        surroundings["env"] |= environment or {}
        started: Any = subprocess.Popen(list(words), **surroundings, **streams)  # noqa: S603 - our words, no shell
        return started

    def start_bare(self, arguments: Sequence[str], **streams: Any) -> subprocess.Popen[bytes]:
        """Start tshark in the same surroundings without our dissector: a measure for it."""
        return self._start([self._program, "-n", *arguments], **streams)

    def run(self, *arguments: str, stdin: IO[bytes] | None = None) -> subprocess.CompletedProcess[bytes]:
        """Run tshark to its end; its output and messages are in the result."""
        return self._run(self.command(*arguments), stdin or subprocess.DEVNULL)

    def _start(self, words: list[str], **streams: Any) -> subprocess.Popen[bytes]:
        started: Any = subprocess.Popen(words, **self._surroundings(), **streams)  # noqa: S603 - our words, no shell
        return started

    def _run(self, words: list[str], stdin: IO[bytes] | int = subprocess.DEVNULL) -> subprocess.CompletedProcess[bytes]:
        with self._start(words, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            try:
                output, messages = process.communicate()
            except BaseException:
                process.kill()
                raise
        return subprocess.CompletedProcess(words, process.returncode, output, messages)

    def fields(self) -> list[tuple[str, str, str, str]]:
        """Return the fields of our protocol, in its order: (name in the tree, filter, type, description).

        The type is Wireshark's, such as ``FT_UINT16``; expert notes are fields of type ``FT_NONE``, in no order.
        """
        # -G serves as the first word only.
        listing = self._run([self._program, "-G", "fields", "-X", f"lua_script:{self._lua}"])
        rows = [line.split("\t") for line in listing.stdout.decode(errors="replace").splitlines()]
        return [(row[1], row[2], row[3], row[7]) for row in rows if len(row) > 7 and row[0] == "F" and row[4] == "daly"]

    @property
    def _lua(self) -> Path:
        return self._home / "lua" / "daly.lua"

    def _prepare(self) -> None:
        source = dissector_folder()
        if not (source / "daly.lua").is_file():
            raise Problem(f"the dissector is not where it should be: {source}; install dalyshark again")
        lua = self._home / "lua"
        lua.mkdir()
        own = os.environ.get("DALYSHARK_DISSECTOR")
        if own and not Path(own).is_file():
            raise Problem(f"DALYSHARK_DISSECTOR is {own}, which is no file; name a dissector of one file, or unset it")
        for file in () if own else source.glob("*.lua"):
            shutil.copyfile(file, lua / file.name)
            (lua / file.name).chmod(0o644)
        if own:
            shutil.copyfile(own, self._lua)
            self._lua.chmod(0o644)
        proof = self._home / "proof.pcap"
        proof.write_bytes(_PROOF)
        for folder in (self._home, lua):
            folder.chmod(0o755)
        if self._as_root:
            os.chown(self._home, ORDINARY_USER, ORDINARY_USER)
        proof.chmod(0o644)
        self._prove(proof)

    def _prove(self, proof: Path) -> None:
        try:
            first = self.run("-r", str(proof), "-T", "fields", "-e", "daly.kind", "-e", "_ws.expert.message")
            version = self._run([self._program, "--version"])
        except OSError as error:
            raise Problem(f"{self._program} does not start: {error.strerror}") from None
        self.version = _version(version.stdout.decode(errors="replace"))
        if first.stdout.split() == [b"frame", b"frame"]:
            return
        messages = first.stderr.decode(errors="replace")
        complaint = lua_complaint(messages) or lua_complaint(first.stdout.decode(errors="replace"))
        if complaint:
            raise Problem(f"our dissector breaks in tshark {self.version}: {complaint}; install dalyshark again")
        said = messages.strip().splitlines()
        why = said[-1] if said and "daly.kind" not in messages else "it ignores Lua scripts"
        raise Problem(
            f"tshark {self.version} does not load our dissector: {why}; is it built with Lua (tshark --version tells)?"
        )

    def _surroundings(self) -> dict[str, Any]:
        home = str(self._home)
        environment = {
            **{name: value for name, value in os.environ.items() if not name.startswith(("WIRESHARK_", "XDG_"))},
            **{name: value for name, value in os.environ.items() if name == "WIRESHARK_DATA_DIR"},
            "HOME": home,
            "WIRESHARK_CONFIG_DIR": home,
            "XDG_CONFIG_HOME": home,
            "APPDATA": home,
            "LC_ALL": "C.UTF-8",
        }
        surroundings: dict[str, Any] = {"env": environment}
        if self._as_root:
            surroundings |= {"user": ORDINARY_USER, "group": ORDINARY_USER, "extra_groups": ()}
        return surroundings


def _version(text: str) -> str:
    for word in text.split():
        if word[:1].isdigit() and "." in word:
            return word.rstrip(".")
    return "of unknown version"


def _anyone_enters(folder: Path) -> bool:
    """Tell whether every user may go into this folder, which exists, and all above it."""
    folder = folder.resolve()
    return all(each.stat().st_mode & stat.S_IXOTH for each in (folder, *folder.parents))


def _anyone_reads(path: Path) -> bool:
    """Tell whether every user may read this file: its own bits and those of all folders above it."""
    try:
        path = path.resolve()
        return _anyone_enters(path.parent) and bool(path.stat().st_mode & stat.S_IROTH)
    except OSError:
        return False


def lua_complaint(messages: str) -> str | None:
    """Return what tshark says about an error in our Lua, as one line, or None."""
    lines = messages.splitlines()
    for at, line in enumerate(lines):
        if "Lua:" in line or "Lua Error" in line:
            more = lines[at + 1 : at + 2] if line.rstrip().endswith(":") else []  # what it was stands below
            return " ".join(part.strip() for part in (line, *more))
    return None
