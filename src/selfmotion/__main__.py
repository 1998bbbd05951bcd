"""`python -m selfmotion` is the command `selfmotion`."""

from selfmotion.shell.cli import main

main()
