# SPDX-License-Identifier: GPL-2.0-or-later
"""A directory of Parquet files by board, day and the like: a Hive-partitioned data set, that grows capture by capture.

    OUT/board=1/day=2026-03-05/4f1c..9a-0.parquet      named for what the capture holds, and a number

Files are written beside OUT and take their places at the end, whole. A capture that is added again replaces its own
files: the same name, the same rows.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final, cast

from pyarrow import parquet

from dalytools.exports.arrow_schema import arrow_schema
from dalytools.exports.parquet_file import ParquetFile
from dalytools.exports.schema import TIME
from dalytools.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import pyarrow as pa

    from dalytools.exports.rows import Row
    from dalytools.exports.schema import Column

NO_VALUE: Final = "__HIVE_DEFAULT_PARTITION__"
"""What Hive, Spark, DuckDB and Polars take for null in a directory's name."""
KEYS: Final = ("board", "day", "month", "transport")
_FROM_TIME: Final = {"day": "%Y-%m-%d", "month": "%Y-%m"}
_parquet: Any = parquet  # its stubs are not complete
_SUFFIX: Final = ".parquet"

# What a hostile capture may make the writer hold.
_MOST_OPEN: Final = 64
_MOST_LOOSE_ROWS: Final = 8192
_MOST_ROWS: Final = 131_072
_MOST_FILES: Final = 10_000

_Place = tuple[str, ...]
"""Names of directories: ``board=1``, ``day=2026-03-05``."""


@dataclass(slots=True)
class _Part:
    """A file that is being written."""

    out: BinaryIO
    rows: ParquetFile


@dataclass(slots=True)
class _Input:
    """The files of one capture so far: paths beside OUT, by place."""

    files: dict[_Place, list[Path]] = field(default_factory=dict[_Place, list[Path]])


class DataSet:
    """Takes rows, capture by capture. Use as: put .. end_file, put .. end_file, commit; else discard."""

    def __init__(self, place: str, keys: Sequence[str], columns: Sequence[Column]) -> None:
        """keys: of KEYS, or columns of text. Raises Problem where something else is there already."""
        self._place = Path(os.path.realpath(place))
        self._shown = place
        self._keys = keys
        self._columns = [column for column in columns if column.name not in keys]
        self._check_present()
        try:
            beside = tempfile.mkdtemp(prefix=f".{self._place.name}.", suffix=".part", dir=self._place.parent)
        except OSError as error:
            raise Problem(f"{place}: cannot be written: {error.strerror}; name another directory with -o") from None
        self._beside = Path(beside)
        self._open: dict[_Place, _Part] = {}  # the one used longest ago first
        self._input = _Input()
        self._done: list[tuple[str, _Input]] = []
        self._files = 0
        self._loose = 0

    def put(self, row: Row) -> None:
        """Take a row."""
        place = tuple(f"{key}={self._value(key, row)}" for key in self._keys)
        part = self._open.pop(place, None) or self._new_part(place)
        self._open[place] = part
        part.rows.put({name: value for name, value in row.items() if name not in self._keys})
        self._loose += 1
        if self._loose >= _MOST_LOOSE_ROWS:
            self._loose = 0
            for other in self._open.values():
                other.rows.pack()
            while sum(other.rows.waiting for other in self._open.values()) >= _MOST_ROWS:
                max(self._open.values(), key=lambda other: other.rows.waiting).rows.flush()

    def end_file(self, fingerprint: str) -> None:
        """Take the end of a capture; fingerprint: names what was taken of it."""
        while self._open:
            self._close_oldest()
        if self._input.files:
            self._done.append((fingerprint, self._input))
        self._input = _Input()

    def commit(self) -> None:
        """Give all files their places."""
        if not self._done:
            self.discard()
            return
        tree = self._beside / "tree"
        kept: set[Path] = set()
        for fingerprint, files in self._done:
            for place, paths in files.files.items():
                folder = tree.joinpath(*place)
                folder.mkdir(parents=True, exist_ok=True)
                for number, path in enumerate(paths):
                    name = f"{fingerprint}-{number}{_SUFFIX}"
                    path.replace(folder / name)
                    kept.add(Path(*place, name))
        try:
            tree.rename(self._place)  # in one go, where nothing is there yet
        except OSError:
            if not self._place.is_dir():
                raise
            self._check_present()  # somebody else may have made it meanwhile
            for path in sorted(kept):
                there = self._place / path
                there.parent.mkdir(parents=True, exist_ok=True)
                (tree / path).replace(there)
            self._remove_others(kept)
        self.discard()

    def discard(self) -> None:
        """Remove what has not taken its place."""
        for part in self._open.values():
            part.rows.abandon()
            with suppress(OSError):  # the file goes
                part.out.close()
        self._open.clear()
        shutil.rmtree(self._beside, ignore_errors=True)

    def _value(self, key: str, row: Row) -> str:
        if key in _FROM_TIME:
            time_ns = row.get(TIME.name)
            try:
                return f"{datetime.fromtimestamp(int(str(time_ns)) // 1_000_000_000, UTC):{_FROM_TIME[key]}}"
            except (OverflowError, ValueError, OSError):
                return NO_VALUE
        value = row.get(key)
        return NO_VALUE if value is None else str(value)

    def _new_part(self, place: _Place) -> _Part:
        self._files += 1
        if self._files > _MOST_FILES:
            raise Problem(
                f"{self._shown}: more than {_MOST_FILES} files would come of this; give --partition fewer names, "
                "or look at the times in the captures"
            )
        if len(self._open) >= _MOST_OPEN:
            self._close_oldest()
        path = self._beside / str(self._files)
        self._input.files.setdefault(place, []).append(path)
        out = path.open("xb")
        return _Part(out, ParquetFile(out, self._columns))

    def _close_oldest(self) -> None:
        place = next(iter(self._open))
        part = self._open[place]
        part.rows.close()
        part.out.flush()
        os.fsync(part.out.fileno())
        part.out.close()
        del self._open[place]

    def _check_present(self) -> None:
        """See that what is there already has the same keys and columns."""
        if not self._place.exists():
            return
        if not self._place.is_dir():
            raise Problem(f"{self._shown} is a file; a data set is a directory: name another with -o")
        first = next(_parquet_files(self._place), None)
        if first is None:
            if any(self._place.iterdir()):
                raise Problem(f"{self._shown} holds no data set, but other files; name another directory with -o")
            return
        keys = [name.partition("=")[0] for name in first.relative_to(self._place).parts[:-1]]
        if keys != list(self._keys):
            there = ",".join(keys) or "nothing"
            raise Problem(
                f"{self._shown} is partitioned by {there}; say so with --partition, or name another directory"
            )
        try:
            present = cast("pa.Schema", _parquet.read_schema(first))
        except (OSError, ValueError) as error:
            raise Problem(f"{first}: cannot be read as Parquet ({error}); name another directory with -o") from None
        mine = arrow_schema(self._columns)
        if not present.equals(mine):
            other = sorted(set(map(str, present)) ^ set(map(str, mine)))
            raise Problem(
                f"{self._shown} has other columns ({', '.join(other[:3])}); give the --rows, --fields and --label that "
                "it was made with, or name another directory"
            )

    def _remove_others(self, kept: set[Path]) -> None:
        """Remove files of captures that were added again and have other files now."""
        marks = {fingerprint for fingerprint, _ in self._done}
        for path in _parquet_files(self._place):
            if path.name.partition("-")[0] in marks and path.relative_to(self._place) not in kept:
                path.unlink(missing_ok=True)


def _parquet_files(place: Path) -> Iterator[Path]:
    for folder, _, names in os.walk(place):
        for name in names:
            if name.endswith(_SUFFIX):
                yield Path(folder, name)
