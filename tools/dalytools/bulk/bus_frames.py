# SPDX-License-Identifier: GPL-2.0-or-later
"""The A5 frames of one bus as columns: what stands in them, when they came, and what is found out about each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from dalyref import addresses, bursts

if TYPE_CHECKING:
    from dalytools.bulk.arrays import Bytes, Flags, Ints, Words

IS_BURST: Final = np.array([data_id in bursts.IDS for data_id in range(256)], np.bool_)
"""By data ID: it answers in several frames."""
BOARD: Final = np.array([addresses.board(address) for address in range(256)], np.uint8)
"""By address byte; 0 where it is not known."""
ONLY: Final = np.array([addresses.only_board(address) for address in range(256)], np.uint8)
"""By address byte: the one board whose reply a request takes, 0: any board's."""


@dataclass(slots=True)
class BusFrames:
    """Frames of one bus in the order of the file, a row each."""

    row: Ints
    """Among the records they are of; of frames from earlier ones negative."""
    start_ns: Ints
    end_ns: Ints
    latest_ns: Ints
    """The latest beginning of a frame of any dialect on this bus, up to this one."""
    side: Bytes
    words: Words
    direction: Bytes
    """1 request, 2 reply, 3 echo; of those not looked at yet 1 or 2."""
    answers: Flags
    """Of replies: it begins an answer (a frame further on in its burst does not)."""
    behind_damage: Flags
    """The record right before it in its stream is damaged."""

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.row)

    def byte(self, at: int) -> Bytes:
        """Return one byte of each frame."""
        return self.words.view(np.uint8).reshape(-1, 16)[:, at]

    def part(self, which: slice | Ints | Flags) -> BusFrames:
        """Return some of the rows."""
        return BusFrames(
            self.row[which],
            self.start_ns[which],
            self.end_ns[which],
            self.latest_ns[which],
            self.side[which],
            part_of(self.words, which),
            self.direction[which],
            self.answers[which],
            self.behind_damage[which],
        )

    def behind(self, earlier: BusFrames) -> BusFrames:
        """Return the rows of `earlier`, and these behind them."""
        if not len(earlier):
            return self
        return BusFrames(
            np.concatenate((earlier.row, self.row)),
            np.concatenate((earlier.start_ns, self.start_ns)),
            np.concatenate((earlier.end_ns, self.end_ns)),
            np.concatenate((earlier.latest_ns, self.latest_ns)),
            np.concatenate((earlier.side, self.side)),
            np.concatenate((earlier.words, self.words)),
            np.concatenate((earlier.direction, self.direction)),
            np.concatenate((earlier.answers, self.answers)),
            np.concatenate((earlier.behind_damage, self.behind_damage)),
        )

    def bytes_of(self, at: int) -> bytes:
        """Return the thirteen bytes of one frame."""
        return self.words[at].tobytes()[:13]


def risen(values: Ints, least: int) -> Ints:
    """Return the largest up to each place, and `least` where that is larger."""
    if not len(values) or (values[0] >= least and (values[1:] >= values[:-1]).all()):
        return values
    return np.maximum.accumulate(np.maximum(values, least))


def part_of(words: Words, which: slice | Ints | Flags) -> Words:
    """Return some rows: sixteen bytes each are quicker to pick than two numbers each."""
    return words.view("V16")[:, 0][which].view(np.uint64).reshape(-1, 2)


def rows_of(words: Words, which: Ints) -> Bytes:
    """Return the sixteen bytes of some frames."""
    return words.view("V16")[:, 0][which].view(np.uint8).reshape(*which.shape, 16)


def first_direction(address: Bytes) -> Bytes:
    """Return request or reply by the address byte: an echo is a request so far."""
    host = (address >= addresses.FIRST_HOST).view(np.uint8)
    return np.uint8(addresses.REPLY) - host * np.uint8(addresses.REPLY - addresses.REQUEST)
