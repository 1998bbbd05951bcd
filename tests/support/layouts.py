"""What can be seen of a page: nothing is cut, out of the page, or over something else."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
# Drawn without a graphics card, where smooth edges would take half of the time.
_OPTIONS = (
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"),
    "--webgl-antialias-mode=none",
)

WIDTHS = (400, 800, 1400)

# Boxes are compared in pixels of the page; half of one is rounding.
_LOOK = """({ texts, boxes }) => {
  const width = document.documentElement.clientWidth, found = [];
  const shown = (element) => element.checkVisibility() && element.getClientRects().length > 0;
  const name = (element) => element.id ? `#${element.id}` : element.className?.baseVal === undefined
    ? `${element.localName}.${element.className}` : element.localName;
  const scrolls = (element) => ["auto", "scroll"].includes(getComputedStyle(element).overflowX)
    || ["auto", "scroll"].includes(getComputedStyle(element).overflowY);
  const wide = document.documentElement.scrollWidth;
  if (wide > width) found.push(`the page is ${wide} wide`);
  const all = (wanted) => wanted.flatMap((selector) =>
    [...document.querySelectorAll(selector)].filter(shown));
  const within = (element) => {
    let { left, right, top, bottom } = element.getBoundingClientRect();
    for (let above = element.parentElement; above; above = above.parentElement) {
      const around = above.getBoundingClientRect();
      if (above === document.body || scrolls(above)) {
        // What can be scrolled to can be seen, if the scroller can.
        ({ left, right, top, bottom } = around);
      } else if (getComputedStyle(above).overflowX !== "visible") {
        if (left < around.left - 0.5 || right > around.right + 0.5
            || top < around.top - 0.5 || bottom > around.bottom + 0.5) return false;
      }
    }
    return left >= -0.5 && right <= width + 0.5;
  };
  const seen = all([...texts, ...boxes]);
  for (const element of seen) {
    const { left, right } = element.getBoundingClientRect();
    if (!within(element) || ((left < -0.5 || right > width + 0.5)
        && !element.closest("#steps, .wide, .highlight, .md-typeset__scrollwrap"))) {
      found.push(`${name(element)} is not within the page: ${left} to ${right}`);
    }
  }
  for (const element of all(texts)) {
    if (getComputedStyle(element).overflowX !== "visible"
        && (element.scrollWidth > element.clientWidth + 1
          || element.scrollHeight > element.clientHeight + 1)) {
      found.push(`${name(element)} is cut: ${element.textContent.slice(0, 40)}`);
    }
  }
  const apart = all(boxes);
  for (let i = 0; i < apart.length; i++) for (let j = i + 1; j < apart.length; j++) {
    const [a, b] = [apart[i], apart[j]];
    if (a.contains(b) || b.contains(a) || a.closest("#steps") || b.closest("#steps")) continue;
    const [one, two] = [a.getBoundingClientRect(), b.getBoundingClientRect()];
    const x = Math.min(one.right, two.right) - Math.max(one.left, two.left);
    const y = Math.min(one.bottom, two.bottom) - Math.max(one.top, two.top);
    if (x > 1 && y > 1) found.push(`${name(a)} and ${name(b)} are over each other`);
  }
  return [seen.length, found];
}"""


@contextmanager
def chromium() -> Iterator[Any]:
    """Yield a browser, or skip where there is none."""
    if CHROMIUM is None:
        pytest.skip("needs Chromium on the path (Debian: apt-get install chromium); CI has it")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=_OPTIONS)
        try:
            yield browser
        finally:
            browser.close()


def faults(page: Any, texts: Sequence[str], boxes: Sequence[str], width: int) -> list[str]:
    """Return what cannot be seen of a page at a width, in words.

    `texts` are selectors of what must be within the page and not cut, `boxes` of what must be
    within it and not over each other.
    """
    page.set_viewport_size({"width": width, "height": 800})
    # What is laid out anew by scripts is so in the next frame.
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")
    count, found = page.evaluate(_LOOK, {"texts": list(texts), "boxes": list(boxes)})
    assert count, f"nothing to be seen of {texts}, {boxes}"
    return list(found)
