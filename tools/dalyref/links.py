# SPDX-License-Identifier: GPL-2.0-or-later
"""A request and its reply, told about each other (docs/records.md, section 7)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from dalyref.options import NANO, TOLERANCE_NS

if TYPE_CHECKING:
    from dalyref.slate import Slate
    from dalyref.streams import Located


class Asked(Protocol):
    """A request of any dialect."""

    number: int
    """Of its packet."""
    end_ns: int
    owner: Slate


def link(request: Asked, located: Located, slate: Slate) -> None:
    """Link the request and the reply on `slate`: packets both ways, and how long it took."""
    fields = slate.fields
    fields["daly.request_in"] = request.number
    after_ns = located.start_ns - request.end_ns
    if after_ns >= -TOLERANCE_NS:  # else the time stamps can't tell
        fields["daly.response_time"] = max(after_ns, 0) / NANO
    request.owner.fields["daly.reply_in"] = located.packet.number
    waits_no_longer(request)


def waits_no_longer(request: Asked) -> None:
    """Nothing more shall be said of a request."""
    request.owner.asks = False
    request.owner.close()
