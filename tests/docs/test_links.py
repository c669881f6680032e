# SPDX-License-Identifier: GPL-2.0-or-later
"""Links in the repository's pages lead somewhere: to a file in it, and to a heading that is there."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SKIPPED = {".venv", ".cache", "node_modules", "dist", "build"}
PAGES = sorted(
    path
    for path in ROOT.rglob("*.md")
    if not any(part in SKIPPED or part[0] == "." for part in path.relative_to(ROOT).parts)
)

FENCE = re.compile(r"^( *)(```|~~~).*?^\1\2", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"`[^`\n]*`")
LINK = re.compile(r"!?\[[^\]]*\]\(<?([^)\s>]+)>?[^)]*\)")


def text_of(page: Path) -> str:
    """The page without its code, which holds no links."""
    return CODE.sub("", FENCE.sub("", page.read_text(encoding="utf-8")))


def links_of(page: Path) -> list[str]:
    return LINK.findall(text_of(page))


def headings_of(page: Path) -> set[str]:
    """Anchors of a page's headings, as forges make them: small letters, no punctuation, dashes for blanks."""
    lines = FENCE.sub("", page.read_text(encoding="utf-8")).splitlines()
    titles = [line.lstrip("#").strip() for line in lines if re.match(r"#{1,6} ", line)]
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def broken(page: Path, link: str) -> str | None:
    """What is wrong with a link of this page; None: nothing, or it leads out of the repository."""
    if re.match(r"[a-z][a-z0-9+.-]*:", link):
        return None
    path, _, anchor = link.partition("#")
    target = (page.parent / path).resolve() if path else page
    if not target.is_relative_to(ROOT):
        return "leaves the repository"
    if not target.exists():
        return "is not there"
    if anchor and anchor not in headings_of(target):
        return "has no such heading"
    return None


def test_there_are_pages() -> None:
    assert ROOT / "README.md" in PAGES
    assert ROOT / "docs" / "records.md" in PAGES


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    wrong = {link: why for link in links_of(page) if (why := broken(page, link))}
    assert not wrong


def test_a_broken_link_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{__name__}.ROOT", tmp_path, raising=True)
    page = tmp_path / "page.md"
    page.write_text("# One two, three\n[a](no.md) [b](page.md#one-two-three) [c](#none) `[d](code.md)`\n[e](../x)\n")
    assert links_of(page) == ["no.md", "page.md#one-two-three", "#none", "../x"]
    assert [broken(page, link) for link in links_of(page)] == [
        "is not there",
        None,
        "has no such heading",
        "leaves the repository",
    ]


def test_linked_files_are_in_git() -> None:
    """A link to a file that only this machine has would be broken for all others."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if listed.returncode != 0:
        pytest.skip("not a git work tree")
    known = {ROOT / name for name in listed.stdout.decode().split("\0") if name}
    known |= {folder for path in known for folder in path.parents}
    local = [
        (str(page.relative_to(ROOT)), link)
        for page in PAGES
        if page in known
        for link in links_of(page)
        if broken(page, link) is None and not re.match(r"[a-z][a-z0-9+.-]*:|#", link)
        if (page.parent / link.partition("#")[0]).resolve() not in known
    ]
    assert not local
