"""Links of the pages lead somewhere: to a file of the repository, and where they name one, to a heading of it."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).parent.parent
_FENCE = re.compile(r"^( *)(```+|~~~+).*?^\1\2[`~]* *$", re.MULTILINE | re.DOTALL)
_CODE_SPAN = re.compile(r"(?<!`)(`+)(?!`)(.+?)(?<!`)\1(?!`)", re.DOTALL)
_TARGETS = (
    re.compile(r"\]\(\s*<?([^\s()<>]+)>?(?:\s+[\"'][^)]*)?\s*\)"),  # [text](target "title") and ![text](source)
    re.compile(r"^ {0,3}\[[^\]^]+\]:\s*<?([^\s<>]+)", re.MULTILINE),  # [text]: target
    re.compile(r"<(?:a|img)\s[^>]*?(?:href|src)=[\"']([^\"']+)", re.IGNORECASE),
)
_HEADING = re.compile(r"^#{1,6} +(.*?)(?: +#+)? *$", re.MULTILINE)
_ANCHOR = re.compile(r"<a\s[^>]*?(?:id|name)=[\"']([^\"']+)", re.IGNORECASE)
_SCHEME = re.compile(r"[a-z][a-z0-9+.-]*:|//", re.IGNORECASE)
# a place of the repository in running text: `service/app.py` on a page, docs/formats.md in a docstring
_NAMED_PLACE = re.compile(r"`((?:service|model_store|clients|docker|docs|tests|\.ci)/[\w./-]*)`")
_NAMED_PAGE = re.compile(r"\b((?:docs|docker|clients)/[\w./-]+\.md)\b(#[\w-]+)?")
_PROGRAMS = (".py", ".c", ".h", ".toml", ".yaml", ".sh", "Makefile", "Dockerfile")
_OWN_NAME = "tests/test_links.py"  # its examples are broken on purpose


@dataclass(frozen=True)
class Tree:
    """The files of a repository: what a clone has, not what happens to lie there."""

    root: Path
    files: frozenset[str]
    _anchors: dict[str, frozenset[str]] = field(default_factory=dict)

    @classmethod
    def tracked(cls, root: Path) -> Tree:
        """What git knows of."""
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=root, check=True, capture_output=True, text=True)
        return cls(root, frozenset(name for name in listed.stdout.split("\0") if (root / name).is_file()))

    @cached_property
    def places(self) -> frozenset[str]:
        """Files and folders."""
        return self.files.union(str(folder) for name in self.files for folder in PurePosixPath(name).parents)

    def text(self, name: str) -> str:
        """The text of a file."""
        return (self.root / name).read_text(encoding="utf-8")

    def anchors(self, page: str) -> frozenset[str]:
        """What `#...` may say of a page."""
        if page not in self._anchors:
            self._anchors[page] = frozenset(anchors_of(self.text(page)))
        return self._anchors[page]

    def broken(self) -> list[str]:
        """`file:line: target` of every link and every named place that leads nowhere."""
        found = []
        for name in sorted(self.files):
            for line, target, start in self._ways_from(name):
                if self.leads_nowhere(start, target):
                    found.append(f"{name}:{line}: {target}")
        return found

    def _ways_from(self, name: str) -> Iterator[tuple[int, str, str]]:
        """Line and target of all that a file points at, and the page from whose folder the target counts."""
        if name.endswith(".md"):
            text = self.text(name)
            yield from ((line, target, name) for line, target in links_of(text))
            yield from ((line, place, "at the root") for line, place in named_places_of(text))
        elif name.endswith(_PROGRAMS) and name != _OWN_NAME:
            yield from ((line, page, "at the root") for line, page in named_pages_of(self.text(name)))

    def leads_nowhere(self, page: str, target: str) -> bool:
        """Whether a relative target of a page is not a place of the repository, or not a heading of it."""
        path, _, anchor = unquote(target).partition("#")
        place = page
        if path:
            parts: list[str] = [] if path.startswith("/") else list(PurePosixPath(page).parent.parts)
            for part in path.split("/"):
                if part == "..":
                    if not parts:
                        return True
                    parts.pop()
                elif part not in ("", "."):
                    parts.append(part)
            place = "/".join(parts) or "."
        if place not in self.places:
            return True
        return bool(anchor) and not (place.endswith(".md") and anchor in self.anchors(place))


def without_code(text: str) -> str:
    """The page with blanks in place of code, so that lines stay what they are."""

    def blank(found: re.Match[str]) -> str:
        return re.sub(r"[^\n]", " ", found[0])

    return _CODE_SPAN.sub(blank, _FENCE.sub(blank, text))


def _with_lines(text: str, found: Iterator[re.Match[str]]) -> Iterator[tuple[int, str]]:
    for each in found:
        yield text.count("\n", 0, each.start(1)) + 1, "".join(filter(None, each.groups()))


def links_of(text: str) -> list[tuple[int, str]]:
    """Line and target of each link and image of a page that stays in the repository."""
    plain = without_code(text)
    links = [link for pattern in _TARGETS for link in _with_lines(plain, pattern.finditer(plain))]
    return sorted(link for link in links if not _SCHEME.match(link[1]))


def named_places_of(text: str) -> list[tuple[int, str]]:
    """Line and path of each file or folder that a page names as code."""
    return list(_with_lines(text, _NAMED_PLACE.finditer(text)))


def named_pages_of(source: str) -> list[tuple[int, str]]:
    """Line and path of each page that a docstring, a comment or a text of a program names."""
    return list(_with_lines(source, _NAMED_PAGE.finditer(source)))


def anchors_of(text: str) -> Iterator[str]:
    """The anchors of a page as GitHub makes them: a heading's words, numbered where they come again."""
    seen: dict[str, int] = {}
    for heading in _HEADING.findall(_FENCE.sub("", text)):
        shown = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", shown.replace("*", "")).lower().replace(" ", "-")
        count = seen.get(slug, 0)
        seen[slug] = count + 1
        yield f"{slug}-{count}" if count else slug
    yield from _ANCHOR.findall(text)


def test_every_link_of_the_repository_leads_somewhere():
    tree = Tree.tracked(ROOT)
    assert len([link for name in tree.files if name.endswith(".md") for link in links_of(tree.text(name))]) > 50
    assert tree.broken() == []


PAGE = """# A page

See [one](other.md), [a part
of it](other.md#how-it-s-made-1 "title"), [here](#a-page), [the folder](pages/), ![a figure](pages/figure.svg),
[elsewhere](https://example.org/nothing), [the root](/page.md), <img src="pages/figure.svg"> and `service/app.py`.

[later]: other.md#by-hand

```md
[not a link](nowhere.md)
```

"""
OTHER = "## How it's `made`\n\n## How it's made\n\n## How *it-s* made\n## How it-s made\n<a id='by-hand'></a>\n"


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    texts = {
        "page.md": PAGE,
        "other.md": OTHER,
        "docs/deep.md": "[up](../page.md#a-page)\n",
        "pages/figure.svg": "<svg/>",
        "service/app.py": '"""As docs/deep.md says."""\n',
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return Tree(tmp_path, frozenset(texts))


def test_good_links_of_every_kind_are_found_and_followed(tree):
    assert [line for line, _ in links_of(PAGE)] == [3, 4, 4, 4, 4, 5, 5, 7]
    assert tree.broken() == []


@pytest.mark.parametrize(
    ("name", "text", "line", "target"),
    [
        pytest.param("page.md", "[one](gone.md)", 1, "gone.md", id="file"),
        pytest.param("page.md", "\n![a](gone.svg)", 2, "gone.svg", id="image"),
        pytest.param("page.md", '\n\n<img width="9" src="gone.png">', 3, "gone.png", id="html"),
        pytest.param("page.md", "[one]: gone.md", 1, "gone.md", id="reference"),
        pytest.param("page.md", "[one](other.md#made)", 1, "other.md#made", id="anchor"),
        pytest.param("page.md", "[one](#nothing)", 1, "#nothing", id="own anchor"),
        pytest.param("page.md", "[one](service/app.py#L1)", 1, "service/app.py#L1", id="anchor of no page"),
        pytest.param("page.md", "[a\nb](gone.md)", 2, "gone.md", id="over two lines"),
        pytest.param("page.md", "[one](../page.md)", 1, "../page.md", id="outside"),
        pytest.param("page.md", "`service/gone.py`", 1, "service/gone.py", id="named place"),
        pytest.param("docs/deep.md", "[one](page.md)", 1, "page.md", id="wrong folder"),
        pytest.param("service/app.py", '"""See\ndocs/gone.md."""', 2, "docs/gone.md", id="docstring"),
        pytest.param("service/app.py", "# docs/deep.md#part", 1, "docs/deep.md#part", id="anchor in a comment"),
    ],
)
def test_a_broken_link_is_named_with_file_and_line(tree, name, text, line, target):
    (tree.root / name).write_text(text, encoding="utf-8")
    assert f"{name}:{line}: {target}" in tree.broken()


def test_a_file_that_git_does_not_know_is_no_target(tree):
    (tree.root / "made.md").write_text("")
    (tree.root / "page.md").write_text(PAGE + "[it](made.md)")
    assert tree.broken() == ["page.md:13: made.md"]
