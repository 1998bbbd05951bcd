"""`python -m selfmotion` is the command `selfmotion`."""

from selfmotion.cli import main

main()
