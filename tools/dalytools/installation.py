# SPDX-License-Identifier: GPL-2.0-or-later
"""Files of ours in somebody's Wireshark folders: put there, told apart from the user's own changes, taken away again.

    record (installed.json, beside the profile)    path -> SHA-256 of what we wrote there

    there is        recorded    the file is        install         uninstall
    nothing         -           -                  write           -
    a file          as ours     as recorded        replace         remove
    a file          as ours     changed since      ask             ask
    a file          no          another's          ask             leave

A file is written beside its place and renamed. Links are not followed: what is one counts as another's.
"""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Final, cast

from dalytools.bundle import NAME, bundle
from dalytools.extcap_wrapper import wrapper, wrapper_name
from dalytools.problem import Problem
from dalytools.tshark import dissector_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from dalytools.wireshark_folders import WiresharkFolders

PROFILE: Final = "Daly BMS"
RECORD: Final = "dalyshark-installed.json"


class Step(StrEnum):
    """What is done, or would be, with one file."""

    WRITE = "write"
    REPLACE = "replace"
    SAME = "up to date"
    KEEP = "kept, changed by you"
    REMOVE = "remove"
    LEAVE = "left, not ours"


@dataclass(frozen=True, slots=True)
class Done:
    """One file and what was done with it."""

    step: Step
    path: Path


@dataclass(slots=True)
class Installation:
    """What belongs into the folders of one Wireshark.

    ask: called with a question where a file would be overwritten or removed that is not as we left it; True: do it.
    dry_run: nothing is touched, and nothing asked.
    """

    folders: WiresharkFolders
    ask: Callable[[str], bool] = field(default=lambda _: False)
    dry_run: bool = False

    def install(self) -> list[Done]:
        """Put all parts in place. Raises Problem where a folder can't be written."""
        known = self._recorded()
        done: list[Done] = []
        for path, content in self._parts().items():
            step = self._step(path, content, known)
            if step in (Step.WRITE, Step.REPLACE) and not self.dry_run:
                _write(path, content, executable=path == self.tool)
                known[str(path)] = _digest(content)
            elif step is Step.SAME:
                known[str(path)] = _digest(content)
            done.append(Done(step, path))
        if not self.dry_run:
            self._record(known)
        return done

    def uninstall(self) -> list[Done]:
        """Take away what is recorded. Raises Problem where a file can't be removed."""
        known = self._recorded()
        done: list[Done] = []
        for name, digest in sorted(known.items()):
            path = Path(name)
            if not path.is_file() and not path.is_symlink():
                continue
            ours = not path.is_symlink() and _digest(path.read_bytes()) == digest
            if not ours and (self.dry_run or not self.ask(f"{path} was changed since it was installed; remove it?")):
                done.append(Done(Step.KEEP, path))
                continue
            if not self.dry_run:
                _remove(path)
            done.append(Done(Step.REMOVE, path))
        if not self.dry_run:
            kept = {each.path for each in done if each.step is Step.KEEP}
            left = {name: digest for name, digest in known.items() if Path(name) in kept}
            if left:
                self._record(left)
            else:
                with suppress(OSError):
                    self._record_path.unlink(missing_ok=True)
                    self._record_path.parent.rmdir()  # where nothing else is in it
        return done

    def state(self) -> list[Done]:
        """Tell each part's state, as an install would find it."""
        known = self._recorded()
        quiet = Installation(self.folders, dry_run=True)
        return [Done(quiet._step(path, content, known), path) for path, content in self._parts().items()]

    @property
    def tool(self) -> Path:
        """Where the capture tool is."""
        return self.folders.extcap / wrapper_name()

    def others(self) -> list[Path]:
        """Find dissectors of ours in the plugin folder that this program did not put there."""
        ours = self.folders.plugins / NAME
        found = self.folders.plugins.rglob("*.lua") if self.folders.plugins.is_dir() else ()
        return sorted(path for path in found if path.name in (NAME, "daly.lua") and path != ours)

    def _parts(self) -> dict[Path, bytes]:
        source = dissector_folder()
        try:
            parts = {self.folders.plugins / NAME: bundle(source).encode(), self.tool: wrapper()}
            for file in sorted((source / "profile").iterdir()):
                if file.is_file():
                    parts[self.folders.profiles / PROFILE / file.name] = file.read_bytes()
        except OSError as error:
            raise Problem(f"the dissector is not where it should be: {error}; install dalyshark again") from None
        return parts

    def _step(self, path: Path, content: bytes, known: Mapping[str, str]) -> Step:
        if path.is_symlink():
            return Step.LEAVE
        if not path.exists():
            return Step.WRITE
        there = path.read_bytes()
        if there == content:
            return Step.SAME if path != self.tool or os.access(path, os.X_OK) else Step.REPLACE
        if known.get(str(path)) == _digest(there):
            return Step.REPLACE
        what = "was changed since it was installed" if str(path) in known else "is there and not ours"
        if not self.dry_run and self.ask(f"{path} {what}; overwrite it?"):
            return Step.REPLACE
        return Step.KEEP if str(path) in known else Step.LEAVE

    @property
    def _record_path(self) -> Path:
        return self.folders.profiles / PROFILE / RECORD

    def _recorded(self) -> dict[str, str]:
        try:
            told: object = json.loads(self._record_path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return {}
        if not isinstance(told, dict):
            return {}
        inside = (self.folders.plugins, self.folders.profiles / PROFILE, self.folders.extcap)
        items = cast("Iterable[tuple[object, object]]", told.items())  # pyright: ignore[reportUnknownMemberType]
        # A record that somebody wrote does not make us touch other folders.
        return {str(name): str(digest) for name, digest in items if Path(str(name)).parent in inside}

    def _record(self, known: Mapping[str, str]) -> None:
        _write(self._record_path, (json.dumps(dict(known), indent=1) + "\n").encode())


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _write(path: Path, content: bytes, *, executable: bool = False) -> None:
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with beside.open("xb") as out:
                out.write(content)
            if executable:
                beside.chmod(0o755)
            beside.replace(path)
        finally:
            beside.unlink(missing_ok=True)
    except OSError as error:
        raise Problem(f"{path} can not be written: {error.strerror}; is the folder yours?") from None


def _remove(path: Path) -> None:
    try:
        path.unlink()
    except OSError as error:
        raise Problem(f"{path} can not be removed: {error.strerror}; is the folder yours?") from None
