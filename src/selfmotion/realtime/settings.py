"""How the loop decides: every number that changes a command, in one place.

What they do is seen in `make bench NAME=fuzz-realtime` (1,000 scenarios of pushes, late steps,
jumps and faults in a closed loop) and `make bench NAME=latency` (percentiles of a step, and what
short sight costs). None of them is what limits stand on: those hold by `viable`, whatever these
are.
"""

# --- the command
# The pose feedback between two steps [1/s].
GAIN = 20.0
# A command so far from the arm [rad or m] is not what it does: the arm is brought to rest.
FARTHEST = 0.5
# Below this pivot of JJᵀ [m², rad²] the inverse is damped, by up to λ² = the same.
PIVOT = 1e-3
# What the tool may lack of the rate that was asked for, and count as following [m/s, rad/s].
FOLLOWED = 1e-3
# An offset of the tool is known every so many seconds.
OFFSET_STEP = 2e-3

# --- when it stops
# A motion that breaks down within this time [s] is not followed: the arm can stop in less.
SOON = 0.5
# Where limits already hold the tool up, nor one that breaks down within this time [s].
AHEAD = 2.0
# A joint that moves so many times as fast as it may has been thrown out of a singular pose.
WILD = 20.0

# --- the plan over the horizon
# What a plan leaves of the limits to the command, since the tool's feedback and the time between
# nodes need some: distance from the ends [rad or m], and share of speed and acceleration.
ENDS = 5e-3
SPEED = 0.98
ACCELERATION = 0.9
# The first nodes are so far apart [s], unless there are enough for less.
NODES_APART = 0.1
# Added to the Gauss-Newton matrix, relative to its trace: directions that do not act stay put.
REGULAR = 1e-8
# Where a cost does not tell its curvature, that of the joints' speed is added, so many times: less
# where the cost falls as predicted, more where it does not, from the least to the most.
GUESS_LESS = 0.3
GUESS_MORE = 4.0
LEAST_GUESS = 1e-3
MOST_GUESS = 1e6
# Of the predicted fall, what counts as well predicted, and as badly.
WELL = 0.75
BADLY = 0.25
# What rows may be broken by, relative to their range.
BROKEN = 1e-6
# How far coefficients may go in one cycle [rad/s √s].
REACH = 1.0
# Programmes of a cycle: each has the rows that the one before broke.
ROUNDS = 4
# What breaking a row by all of its range costs, next to a step's cost; the range of distances [m].
BREAKING = 1e3
DISTANCES = 0.1

# --- obstacles that move
# Plans aim at this much more than the distance that is asked for [m]: nodes are apart.
CLEARANCE_MARGIN = 5e-3
# From so much beyond on, distances level off [m].
LEVEL = 0.01
# A plan that comes too near within this time [s] is not begun: the arm can stop in less.
CLEAR_FOR = 0.5
# How fast what came too near is to be left [m/s].
LEAVING = 0.05
# What is no more than this nearer than now comes no nearer [m].
NEARER = 1e-4
