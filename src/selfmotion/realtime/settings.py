"""Settings of the control loop: every number that changes a command, in one place.

`make bench NAME=fuzz-realtime` shows their effect (1,000 scenarios of pushes, late steps, jumps and
faults in a closed loop), `make bench NAME=latency` percentiles of a step and the cost of a short
horizon. The guarantee of limits is independent of them: see `viable_accelerations` of `law.py`.
"""

# --- the command
# Gain of the pose feedback between two steps [1/s].
GAIN = 20.0
# Distance of a command from the arm above which the arm is brought to rest [rad or m].
FARTHEST = 0.5
# Pivot of JJᵀ [m², rad²] below which the inverse is damped, by up to λ² = the same.
PIVOT = 1e-3
# Error of the tool's rate that counts as following [m/s, rad/s].
FOLLOWED = 1e-3
# Sampling interval of an offset of the tool [s].
OFFSET_STEP = 2e-3

# Longest time over which commands are averaged for limits of the jerk [s]: the tool leaves its path
# by a 24th of its square times the acceleration, 0.2 mm at 10 m/s².
LONGEST_MEAN = 0.02

# --- chunks
# Time in which the tool comes from rest before the first pose, and to rest after the last one [s].
CHUNK_END = 0.2
# Step of differences of twists, for accelerations at the ends of chunks [s].
DIFFERENCE = 1e-4
# Shortest time in which a chunk is joined [s] …
JOIN_SHORTEST = 0.05
# … factor to the next one that is tried …
JOIN_FACTOR = 1.25
# … and the longest [s].
JOIN_LONGEST = 2.0

# --- the pace
# Knots of the rate, as shares of the horizon.
PACE_KNOTS = (0.0, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0)
# How much faster than its own time a path is followed where the tool is late …
CATCH_UP = 0.25
# … and how fast that fades with the delay [1/s].
CATCHING = 4.0
# Delay that counts as none [s].
ON_TIME = 1e-4
# Weight of squared delays, in horizons, relative to a step's cost …
PACE_WEIGHT = 1e3
# … and of squared deviations from the wanted rate, relative to that.
SMOOTH = 1e-2
# Largest growth of a rate in one step.
PACE_GROWS = 0.05
# Factor of the rates after a segment that is not proved.
SLOWER = 0.95
# Times that a step comes to rest earlier where the motion breaks down.
RETREATS = 2
# Distance of a path from another one, at the same time, that counts as a jump [m, rad].
JUMPED = 1e-2
# While the path right ahead [s] is out of reach, the tool waits for what is in reach again.
RIGHT_AHEAD = 0.1
# What the tool is off its path, or its rate off that of the path, that leaves the pace as it is
# [m, rad, per s].
UNNOTICED = 5e-3
# Rate below which it stands.
STANDING = 0.05
# Newton steps to a pose that is in reach, the largest change of a joint in one [rad or m] …
REACHING = 15
LARGEST = 0.3
# … and the distance from it that counts as none [m, rad].
REACHED = 1e-4

# --- when it stops
# Motions that break down within this time [s] are not followed: the arm stops in less.
SOON = 0.5
# The same where limits already delay the tool [s].
AHEAD = 2.0
# Multiple of its largest speed at which a joint breaks down near a singular pose.
WILD = 20.0

# --- the plan over the horizon
# Reserve of limits in plans, for the feedback and the time between nodes: distance from the ends
# [rad or m] …
ENDS = 5e-3
# … share of the speed …
SPEED = 0.98
# … and of the acceleration.
ACCELERATION = 0.9
# Distance of the first nodes [s], or less if there are enough.
NODE_STEP = 0.1
# Regularisation of the Gauss-Newton matrix, relative to its trace: ineffective directions do not
# move.
REGULAR = 1e-8
# Costs without second derivatives get a multiple of joint speed's: factor after the predicted
# decrease …
GUESS_LESS = 0.3
# … factor after a smaller one …
GUESS_MORE = 4.0
# … smallest multiple …
MIN_GUESS = 1e-3
# … and largest.
MAX_GUESS = 1e6
# Ratio of the decrease to the predicted one that counts as good …
WELL = 0.75
# … and as bad.
BADLY = 0.25
# Largest violation of rows, relative to their range.
BROKEN = 1e-6
# Largest change of coefficients in one cycle [rad/s √s].
REACH = 1.0
# Programmes of a cycle: each has the rows that the one before violated.
ROUNDS = 4
# Penalty of violating a row by its range, relative to a step's cost.
BREAKING = 1e3
# Range of distances [m].
DISTANCES = 0.1

# --- quantities
# Share of a quantity's limit that plans leave unused, for the feedback and the time between nodes.
QUANTITY_RESERVE = 0.05
# The same of those that depend on accelerations, which jump between nodes.
ACCELERATED_RESERVE = 0.1
# Rows with more room than this share of their limit are left out of a step.
NEAR_LIMIT = 0.5
# Rows that no self-motion changes have no larger entry [shares of the limit].
UNMOVED = 1e-4
# Time in which plans leave what is exceeded [s].
LEAVING_IN = 0.5
# Share of a limit that is kept for bounds: of what is beside it, all segments together use it once.
QUANTITY_BEYOND = 1e-4
# Cycles in a group with bounds of its own, and after which what is no function of q̈ is measured.
STRIDE = 8
# Factor of the deceleration of stops that are not proved …
GENTLER = 0.5
# … the gentlest, as a share of the limit …
GENTLEST = 1.0 / 64.0
# … the longest of gentle ones [s] …
LONGEST_STOP = 1.0
# … and by how much the deceleration grows again from one step to the next.
HARDER = 1.02

# --- obstacles that move
# Clearance of plans in addition to the required one, for the time between nodes [m].
CLEARANCE_MARGIN = 5e-3
# Excess of the required distance at which distances saturate [m].
LEVEL = 0.01
# Plans that violate the distance within this time [s] are not started: the arm stops in less.
CLEAR_FOR = 0.5
# Speed of leaving a violated distance [m/s].
LEAVING = 0.05
# What a distance may fall short of by, in all [m]: room for bounds of pairs that are beside it.
NEARER = 1e-4
# Distance from which on pairs of meshes are far [m]: hulls always overlap there.
FAR_MESHES = 0.03
# Intervals of a segment on which its clearance is proved first …
FIRST_CHECKS = 4
# … of such pairs, which take a hundred times as long …
FIRST_OF_MESHES = 1
# … and largest number of configurations that are measured for it: they take time.
MAX_CHECKS = 96
