"""One page that says what a program does, keeps and survives, to be printed."""

from selfmotion.sheet.page import write_sheet as write_sheet
from selfmotion.sheet.sections import Section as Section, sections as sections
