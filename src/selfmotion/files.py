"""Files of problems, jobs, tool motions and joint motions: readers and writers.

A door: what it names is made in `selfmotion.shell.files`.
"""

from selfmotion.shell.files import *  # noqa: F403
from selfmotion.shell.files import Job as Job, __all__ as __all__
