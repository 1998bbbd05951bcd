"""Laws that your own costs, constraints, paths, null motions and optimisers have to keep.

One checker per protocol, for your tests as for ours: it returns nothing, or raises AssertionError
with the law, the place and both numbers. All seeds are fixed.

>>> from selfmotion.testing import check_cost
>>> check_cost(sm.costs.InverseManipulability(0.01))
"""

from selfmotion.shell.testing.constraints import check_constraint as check_constraint
from selfmotion.shell.testing.laws import (
    check_cost as check_cost,
    check_null_motion as check_null_motion,
    check_optimizer as check_optimizer,
    check_path as check_path,
)
