"""One page that says what a program does, keeps and survives, to be printed."""

from selfmotion.shop.sheet.page import (
    Section as Section,
    sections as sections,
    write_sheet as write_sheet,
)
