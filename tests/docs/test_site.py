"""The site is built, offline and without a warning; the examples run while it is built."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
import shown

import selfmotion as sm
from selfmotion import realtime, replay
from selfmotion.shell import testing
from support.doors import named, offered
from support.layouts import WIDTHS, chromium, faults
from support.places import ROOT

pytestmark = pytest.mark.site

EXAMPLES = sorted(file.stem for file in (ROOT / "examples").glob("*.py"))


class Addresses(HTMLParser):
    """Collects what a browser would fetch to show a page."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag in ("script", "img", "iframe", "source"):
            self.found += [given["src"]] if given.get("src") else []
        if tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload", "preconnect"):
            self.found += [given["href"] or ""]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build it; an example that fails, a dead link or a missing docstring ends that."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet"]
    built = subprocess.run(
        [*command, "--config-file", str(ROOT / "docs/mkdocs.yml"), "--site-dir", str(folder)],
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    return folder


def test_nothing_is_fetched_but_the_site_itself(site: Path) -> None:
    pages = [page for page in site.rglob("*.html") if "replays" not in page.parts]
    assert len(pages) > 30
    for page in pages:
        parser = Addresses()
        parser.feed(page.read_text())
        assert parser.found
        for address in parser.found:
            if address.startswith("data:") or page.name == "404.html":
                continue
            assert "://" not in address, f"{page}: {address}"
            assert (page.parent / address.split("?")[0]).exists(), f"{page}: {address}"


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_example_is_shown_with_its_output(site: Path, name: str) -> None:
    text = (site / "examples.html").read_text()
    part = re.split(r"<h[23]", text.split(f'<h3 id="{name}py"')[1])[0]
    assert part.count('<span class="filename">') == 2
    printed = part.split('<span class="filename">prints</span>')[1]
    assert len(re.sub(r"<[^>]*>", "", printed).strip()) > 20


@pytest.mark.parametrize("page", shown.PRINTING, ids=lambda page: page.stem)
def test_every_page_that_runs_shows_what_its_code_makes(site: Path, page: Path) -> None:
    """What each block prints that prints anything, and pictures that say what they show."""
    text = (site / page.relative_to(shown.PAGES).with_suffix(".html")).read_text()
    asked = re.findall(r"^```(?:python|console)\n(.*?)^```", page.read_text(), re.DOTALL | re.M)
    talks = [code for code in asked if "print(" in code or code.startswith("selfmotion plan")]
    assert text.count('<span class="filename">prints</span>') >= len(talks)
    assert '<span class="filename">prints</span>' in text or 'class="replay"' in text
    for image in re.findall(r"<img [^>]*drawings/[^>]*>", text):
        assert len(re.search(r'alt="([^"]*)"', image)[1]) > 40, image
    assert str(ROOT) not in text
    assert "/tmp" not in text


def test_examples_are_short() -> None:
    for name in EXAMPLES:
        # The one's two classes, and the other's two ends of a wire, are the point.
        if name not in ("own_constraint", "udp_bridge"):
            assert len((ROOT / f"examples/{name}.py").read_text().splitlines()) <= 60, name


def test_equations_are_drawn_by_the_browser(site: Path) -> None:
    text = (site / "method.html").read_text()
    assert text.count('<math display="block"') + text.count('display="block"') >= 10
    assert "$" not in re.sub(r"<(script|style).*?</\1>", "", text, flags=re.DOTALL)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as found:
        yield found


def test_search_finds_pages_from_a_folder(site: Path, browser: Any) -> None:
    page, asked = browser.new_page(viewport={"width": 1400, "height": 900}), []
    page.on("request", lambda request: asked.append(request.url))
    page.goto((site / "index.html").as_uri())
    page.keyboard.press("/")
    page.keyboard.type("positioner")
    page.wait_for_selector(".md-search-result__item")
    found = page.locator(".md-search-result__item").all_inner_texts()
    assert any("positioner" in text for text in found)
    assert all(url.startswith(("file:", "data:", "blob:", "about:")) for url in asked)
    page.close()


def test_pages_are_seen_whole(site: Path, browser: Any) -> None:
    """What is read stays within the page; replays, too. Their insides have tests of their own."""
    page = browser.new_page()
    page.route("**/replays/*.html", lambda route: route.fulfill(body="a replay"))
    how_tos = ("howto/relaxations", "howto/retiming", "from_other_tools")
    for name in ("gallery", "index", *how_tos, "method", "api/plan"):
        page.goto((site / f"{name}.html").as_uri())
        for width in WIDTHS:
            texts = ("article h1", "article h2", "article p", "article img")
            boxes = ("iframe.replay", "article h1", "article h2")
            assert faults(page, texts, boxes, width) == [], (name, width)
    page.close()


def test_every_public_name_is_on_one_page_of_the_api(site: Path) -> None:
    pages = "\n".join(page.read_text() for page in (ROOT / "docs/pages/api").glob("*.md"))
    listed = re.findall(r"^::: (\S+)$", pages, re.MULTILINE)
    wanted = [f"selfmotion.{name}" for name in offered(sm)]
    wanted += [f"selfmotion.testing.{name}" for name in named(testing)]
    wanted += [f"selfmotion.replay.{name}" for name in replay.__all__]
    own = set(named(realtime)) - set(sm.__all__)
    wanted += [f"selfmotion.realtime.{name}" for name in own]
    assert sorted(listed) == sorted(wanted)
    shown = "\n".join(page.read_text() for page in (site / "api").glob("*.html"))
    for name in offered(sm):
        assert f'id="selfmotion.{name}"' in shown, name
