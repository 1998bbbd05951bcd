"""One page that says what a program does, keeps and survives, to be printed."""

from selfmotion.shell.sheet.page import write_sheet as write_sheet
