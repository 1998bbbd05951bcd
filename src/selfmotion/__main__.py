"""`python -m selfmotion` is the command `selfmotion`."""

import sys

from selfmotion.cli import main

sys.exit(main())
