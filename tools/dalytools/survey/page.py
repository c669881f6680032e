# SPDX-License-Identifier: GPL-2.0-or-later
"""A survey as a page: one HTML file without a script, that opens offline in any browser, light or dark, on a phone too.

Text of a capture is data, never markup: all of it is escaped, and what does not print is replaced.
"""

from __future__ import annotations

import html
from itertools import groupby
from typing import TYPE_CHECKING, Final

from dalytools import __version__
from dalytools.survey.difference_listing import where
from dalytools.survey.findings import HEADINGS, REQUESTS
from dalytools.survey.heat import STEPS, byte_heat
from dalytools.survey.place import MODBUS
from dalytools.survey.words import held, named, spacing

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dalytools.survey.difference import Difference
    from dalytools.survey.findings import Finding
    from dalytools.survey.survey import Survey

_STYLE: Final = """
:root { color-scheme: light dark; --text: #1d2433; --faint: #5c677d; --line: #d5dae3; --page: #ffffff; --box: #f5f7fa;
  --say: #14663a; --h0: #e8ebf0; --h1: #bcd3ee; --h2: #6ea8dc; --h3: #f0a441; --h4: #d2382f; }
@media (prefers-color-scheme: dark) { :root { --text: #e4e8ef; --faint: #9aa5b8; --line: #363d4a; --page: #14171c;
  --box: #1d2128; --say: #7fd1a0; --h0: #262c36; --h1: #2a4a6e; --h2: #3f80bb; --h3: #d98a25; --h4: #f0574d; } }
body { font: 15px/1.45 system-ui, sans-serif; color: var(--text); background: var(--page); margin: 0 auto;
  max-width: 1100px; padding: 12px 16px 60px; }
h1 { font-size: 1.5em; margin: .3em 0; overflow-wrap: anywhere; } h2 { font-size: 1.2em; margin: 1.8em 0 .5em; }
h3 { font-size: 1em; margin: 0; } .faint { color: var(--faint); }
.place { background: var(--box); border: 1px solid var(--line); border-radius: 8px; padding: 8px 12px; margin: 8px 0; }
.place p { margin: 4px 0; overflow-wrap: anywhere; }
.bytes { display: grid; grid-template-columns: repeat(8, minmax(0, 1fr)); gap: 8px; margin: 6px 0; }
@media (max-width: 700px) { .bytes { grid-template-columns: repeat(4, 1fr); } }
.byte { font: 13px/1.4 ui-monospace, monospace; overflow-wrap: anywhere; }
.bits { display: flex; gap: 1px; } .bits i { flex: 1; height: 16px; border-radius: 2px; }
.key i { display: inline-block; width: 14px; height: 14px; border-radius: 2px;
  vertical-align: -2px; margin: 0 4px 0 12px; }
.h0 { background: var(--h0); } .h1 { background: var(--h1); } .h2 { background: var(--h2); }
.h3 { background: var(--h3); } .h4 { background: var(--h4); }
ul { margin: 4px 0; padding-left: 20px; } li { color: var(--say); overflow-wrap: anywhere; }
code { font: 13px ui-monospace, monospace; } details { margin: 8px 0; } summary { cursor: pointer; }
"""


def survey_page(survey: Survey, findings: Sequence[Finding], names: Sequence[str]) -> str:
    """Return the page of a survey. names: of the files."""
    kinds = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in survey.kinds.most_common())
    left_out = f" {survey.left_out} payloads of further places left out." if survey.left_out else ""
    steps = "".join(f'<i class="h{step}"></i>{_text(words)}' for step, words in enumerate(STEPS))
    body = [
        f"<p>{survey.records} records: {_text(kinds)}; {len(findings)} places.{left_out}</p>",
        f'<p class="key faint">How often a bit flips, bit 7 on the left: {steps}</p>',
    ]
    several = len({one.place.bus for one in findings}) > 1
    for group, of_group in groupby(findings, key=lambda one: one.group):
        places = "\n".join(_places(list(of_group), several=several))
        if group == REQUESTS:
            body.append(f"<details><summary>{_text(HEADINGS[group])}</summary>\n{places}\n</details>")
        else:
            body.append(f"<h2>{_text(HEADINGS[group])}</h2>\n{places}")
    return _page(f"Survey of {', '.join(names)}", body)


def difference_page(found: Difference, names: Sequence[str]) -> str:
    """Return the page of a difference. names: of the two files."""
    body: list[str] = [f"<p>Before: {_text(names[0])}<br>Now: {_text(names[1])}</p>"]
    for heading, places in (("Only now", found.new), ("Only before", found.gone)):
        if places:
            body.append(f"<h2>{heading}</h2>")
            body += [_place(one, several=False) for one in places]
    if found.changed:
        body.append("<h2>Changed, the surest first</h2>")
    for one in found.changed:
        said = "".join(f"<li>{_text(where(one, change))}: {_text(change.text)}</li>" for change in one.changes)
        counts = f"{one.before.stream.count} times before, {one.after.stream.count} now"
        head = f'<h3>{_text(one.after.place.name)}</h3><p class="faint">{counts}</p>'
        body.append(f'<div class="place">{head}<ul>{said}</ul></div>')
    body.append(f"<p>{found.same} places unchanged.</p>")
    return _page(f"What changed from {names[0]} to {names[1]}", body)


def _page(title: str, body: Sequence[str]) -> str:
    policy = "default-src 'none'; style-src 'unsafe-inline'"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{_text(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n<h1>{_text(title)}</h1>\n"
        + "\n".join(body)
        + f'\n<p class="faint">dalyshark {_text(__version__)}</p>\n</body>\n</html>\n'
    )


def _places(findings: Sequence[Finding], *, several: bool) -> Iterator[str]:
    """Give a box a place; registers in a row that never moved, and of which nothing is said, are one together."""
    for quiet, some in groupby(findings, key=_is_quiet_register):
        if not quiet:
            yield from (_place(one, several=several) for one in some)
            continue
        for _, of_one in groupby(some, key=lambda one: (one.place.bus, one.place.who, one.place.dialect)):
            rows = list(of_one)
            bus = f"bus {rows[0].place.bus}: " if several else ""
            words = "; ".join(f"{one.place.number:04X} {one.stream.last.hex().upper()}" for one in rows)
            head = f"{bus}{rows[0].place.who} {rows[0].place.dialect} registers that never moved"
            yield f'<div class="place"><h3>{_text(head)}</h3><p><code>{_text(words)}</code></p></div>'


def _is_quiet_register(one: Finding) -> bool:
    return one.place.dialect in MODBUS and one.place.size == 2 and one.constant and not one.claims


def _place(one: Finding, *, several: bool) -> str:
    stream = one.stream
    bus = f"bus {one.place.bus}: " if several else ""
    parts = [f"<h3>{_text(bus + one.place.name)}</h3>", f'<p class="faint">{_text(spacing(stream))}</p>']
    if stream.last and one.constant:
        still = "seen once" if stream.count == 1 else "never moved"
        parts.append(f"<p><code>{stream.last.hex(' ').upper()}</code> {still}</p>")
    elif stream.last:
        parts.append(f'<div class="bytes">{"".join(_bytes(one))}</div>')
    names = "; ".join(f"{one.place.bytes_name(first, last)} {words}" for first, last, words in named(one))
    if names:
        parts.append(f'<p class="faint">{_text(names)}</p>')
    if one.claims:
        said = "".join(
            f"<li>{_text(one.place.bytes_name(claim.first, claim.last))} {_text(claim.text)} "
            f'<span class="faint">(n {claim.count})</span></li>'
            for claim in one.claims
        )
        parts.append(f"<ul>{said}</ul>")
    return f'<div class="place">{"".join(parts)}</div>'


def _bytes(one: Finding) -> Iterator[str]:
    moves = one.stream.moves
    for index in range(one.place.size):
        bits = "".join(
            f'<i class="h{step}" title="bit {bit}: flipped {moves.flips[8 * index + bit]} of {moves.count - 1}"></i>'
            for bit, step in zip(range(7, -1, -1), byte_heat(moves, index), strict=True)
        )
        span, count = held(one.stream, index)
        values = f"<br>{count} values<br>newest {one.stream.last[index]:02X}" if count else ""
        yield f'<div class="byte"><span class="faint">d{index}</span><div class="bits">{bits}</div>{span}{values}</div>'


def _text(text: str) -> str:
    return html.escape(
        "".join(character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in text)
    )
