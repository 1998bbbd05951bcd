"""What is made while the site is built: pictures, replays, pages with what their code prints."""

import sys
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

sys.path.insert(0, str(Path(__file__).parent))

import drawings
import keys
import shown
from mathml import MathMl

DOCS = Path(__file__).parent
# Made by `make bench NAME=arms`, `make errors`, `pictures.py` and `two_motions.py`; read on their
# own as well.
BESIDE = (
    "arms.md",
    "chains.md",
    "errors.md",
    "places.png",
    "replay.png",
    "two_motions.png",
    "view.png",
    *(f"arms/{f.name}" for f in DOCS.glob("arms/*")),
)
GALLERY = (
    "weld_seam", "weld_corner", "two_arms", "weld_positioner", "weld_downhand", "weld_torch",
    "part_in_hand", "painting", "weld_frame", "in_parts", "own_obstacle", "rail", "closed_loop",
    "ur5_pointing", "mobile_base",
)  # fmt: skip
# What is played at the top of a how-to: the example that it is about.
PLAYED = {
    "seam": "weld_seam",
    "obstacles": "weld_corner",
    "closed": "closed_loop",
    "start": "ur5_pointing",
    "replay": "rail",
    "limits": "painting",
    "job": "weld_frame",
    "parts": "in_parts",
    "cells": "weld_positioner",
    "own": "own_obstacle",
}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Let equations be written, and pages take sections of files of the repository."""
    config.markdown_extensions.append(MathMl())  # type: ignore[arg-type]  # as Markdown takes it
    config.mdx_configs["pymdownx.snippets"]["base_path"] = [str(DOCS.parent)]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what is not in the folder of the pages."""
    for name in BESIDE:
        files.append(File.generated(config, name, abs_src_path=str(DOCS / name)))
    # Before pages make classes of their own, which files would know as well.
    all_keys = keys.keys_page()
    ran = shown.run_all()
    with shown.run_pages() as pages:
        drawn = drawings.draw_all(pages)
    made: dict[str, str] = {
        "examples.md": examples_page(ran),
        "keys.md": all_keys,
        "gallery.md": gallery_page(ran),
        **{f"replays/{name}.html": ran[name].replay() for name in GALLERY},
        **{f"drawings/{name}.svg": text for name, text in drawn.items()},
    }
    for name, content in made.items():
        files.append(File.generated(config, name, content=content))
    for page in pages.values():
        address = page.file.relative_to(shown.PAGES).as_posix()
        files.get_file_from_path(address).content_string = page.text
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Play the example that a how-to is about, below what it begins with."""
    name = PLAYED.get(Path(page.file.src_uri).stem, "")
    if not (page.file.src_uri.startswith("howto/") and name):
        return markdown
    title, first, rest = markdown.split("\n\n", 2)
    caption = f"[{name}.py](../examples.md#{name}py)"
    return "\n\n".join([title, first, _replay(name, "../"), caption, rest])


def examples_page(ran: dict[str, shown.Shown]) -> str:
    """Return the page with the code and the output of each example."""
    parts = [
        "# Examples",
        "Each file of `examples/` is run when this site is built; below each is what it printed. "
        "Copy one and change it.",
    ]
    for group, names in shown.GROUPS.items():
        parts.append(f"## {group}")
        for name in names:
            each = ran[name]
            parts += [f"### {name}.py", each.title, _fenced(each.code, "python", f"{name}.py")]
            parts.append(_fenced(each.output, "text", "prints"))
            if name in GALLERY:
                parts.append(_replay(name))
    cell = (shown.EXAMPLES / "cell.toml").read_text()
    parts += [
        "## From the shell",
        _fenced(cell, "toml", "cell.toml"),
        _fenced(f"selfmotion {shown.SHELL}", "console"),
        _fenced(shown.run_shell(), "text", "prints"),
    ]
    return "\n\n".join(parts)


def gallery_page(ran: dict[str, shown.Shown]) -> str:
    """Return the page with replays."""
    parts = [
        "# Gallery",
        "Replays of the [examples](examples.md): each is one HTML file that plays offline. Turn "
        "the scene by dragging; below it is its [redundancy map](howto/redundancy.md), of a job "
        "that of each seam.",
    ]
    for name in GALLERY:
        parts += [f"## {name.replace('_', ' ')}", ran[name].title, _replay(name)]
    return "\n\n".join(parts)


def _replay(name: str, root: str = "") -> str:
    address = f"{root}replays/{name}.html"
    return f'<iframe class="replay" loading="lazy" title="{name}" src="{address}"></iframe>'


def _fenced(text: str, language: str, title: str = "") -> str:
    mark = f' title="{title}"' if title else ""
    return f"````{language}{mark}\n{text.rstrip()}\n````"
