"""What free motions try, and when they have enough; `make bench-moves` shows what it does."""

# What is beyond a limit by no more than this is within it to rounding, as the certificate has it.
ROUNDING = 1e-12
# After so many seconds a move counts as not found.
MOVE_DEADLINE = 10.0
# Shares of the limits that are used; and the acceleration where nobody limits it: up to full speed
# in so many seconds, which is this one where nobody limits it either [rad/s or m/s].
USED = 0.95
UP_TO_SPEED = 0.25
USUAL_SPEED = 1.0
# Controllers want accelerations without jumps from arms of any make: where nobody limits the jerk,
# they are reached in this time [s]. Knots of a pace are so far apart [s].
SOFT = 0.02
STEP_OF_PACE = 4e-3
# Requirements that depend on the pace may be kept by a slower one, tried so often.
SLOWER_FACTOR = 1.2
SLOWER_TRIES = 12
# Bodies are looked at a bit farther apart than asked for [m], since only at some times. Where the
# certificate finds what was missed, they are so many times farther apart and looked at so many
# times more often, and a way is looked for again, so often.
MOVE_MARGIN = 5e-4
WIDER = 3.0
FINER_LOOKS = 2.0
TRIES_OF_MOVE = 4
# Legs are looked at in steps in which no point of a body moves farther than this [m], finished
# paths closely; and in steps of joints [rad] where there are no bodies. So many looks
# at once to begin with.
LEG_STEP = 0.02
FINE_STEP = 0.005
TURN_STEP = 0.05
FIRST_LOT = 4
# Where the straight leg is blocked, trees begin so far back along the tool's axis as well [m].
RETREATS = (0.01, 0.03, 0.08)
# Trees grow by legs of so many seconds at full speed; this share of the samples lies around the
# middle, so far around, in shares of the distance; others are anywhere.
LEG_RANGE = 1.0
AROUND_MIDDLE = 0.2
SPREAD = 0.5
# The best of so many ways is taken; so many shortcuts are tried on each at most, until so many in
# turn are blocked.
WAYS = 4
SHORTCUTS = 120
MISSED = 30
# Control points of a path to begin with; and how near to each other they may come around corners,
# as a share of the path. Samples of a path at least.
FIRST_POINTS = 12
FINEST = 1e-3
PATH_SAMPLES = 64
# No move is briefer than this [s], also one that leads nowhere. One that is shorter than this
# [rad or m] goes by one smooth law of time, with so many samples.
BRIEFEST_MOVE = 0.02
SHORTEST_PACED = 2e-3
UNHURRIED_SAMPLES = 65
# Configurations for an end that is a pose of the tool, at most.
END_CONFIGURATIONS = 16
