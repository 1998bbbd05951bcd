"""Equations in Markdown, ``$…$`` and ``$$…$$``, as MathML: browsers draw it without scripts."""

import re
from xml.etree.ElementTree import Element

from latex2mathml.converter import convert_to_element
from markdown import Extension, Markdown
from markdown.blockprocessors import BlockProcessor
from markdown.inlinepatterns import InlineProcessor

# Before backslashes are taken for escapes (180), and after code (190).
_PRIORITY = 185


class _Inline(InlineProcessor):
    def handleMatch(self, m: re.Match[str], data: str) -> tuple[Element, int, int]:
        return convert_to_element(m.group(1)), m.start(), m.end()


class _Block(BlockProcessor):
    def test(self, parent: Element, block: str) -> bool:
        return block.startswith("$$") and block.rstrip().endswith("$$")

    def run(self, parent: Element, blocks: list[str]) -> None:
        text = blocks.pop(0).strip().strip("$")
        parent.append(convert_to_element(text, display="block"))


class MathMl(Extension):
    """Makes equations of what stands between dollars."""

    def extendMarkdown(self, md: Markdown) -> None:
        """See `Extension`."""
        md.inlinePatterns.register(_Inline(r"\$([^$\n]+)\$", md), "mathml", _PRIORITY)
        md.parser.blockprocessors.register(_Block(md.parser), "mathml", _PRIORITY)
