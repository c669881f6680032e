# SPDX-License-Identifier: GPL-2.0-or-later
"""Puts frames on an open pseudo-terminal at the pace of 9600 baud, without a pause: 74 a second.

``python -m bench.feeder FD SIZE SECONDS`` writes SIZE bytes at a time, each piece when its last byte would have come in
(8N1: ten bits a byte), and prints how many frames it wrote.
"""

from __future__ import annotations

import os
import sys
import time

from dalyref.a5 import SIZE, build

BYTE_S = 10 / 9600


def main(fd: int, size: int, seconds: float) -> int:
    """Feed whole frames for so long; how many."""
    started = time.monotonic()
    count = sent = 0
    while count * SIZE * BYTE_S < seconds:
        frame = build(1, 0x90, count.to_bytes(8, "big"))
        for at in range(0, SIZE, size):
            piece = frame[at : at + size]
            sent += len(piece)
            wait = started + sent * BYTE_S - time.monotonic()
            if wait > 0:
                time.sleep(wait)
            os.write(fd, piece)
        count += 1
    return count


if __name__ == "__main__":
    print(main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])))
