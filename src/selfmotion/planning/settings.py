"""What planning tries, in what order of effort, and when it has enough.

What these do shows in `make bench` and `make bench-constrained` (single starts), `make
bench-starts` (free starts against the best of everything tried) and `make suite-made`.
"""

# --- grids: how fine a motion is computed (polish, judge)
# Agreement of the cost on few nodes and on twice as many, at which a rough motion tells what its
# start is worth.
ROUGH_AGREEMENT = 1e-2
# Intervals of the first nodes, and so many for each time that the tool goes as far as the arm
# reaches.
FIRST_INTERVALS = 16
# More of them where self-motions start and stop: as shares of the duration from there.
STARTING = (-0.03, -0.01, 0.01, 0.03)
# Between its nodes a motion may be off its path by this [m, rad]. Where it is by more, intervals
# are divided so that it is by that, as the error falls with their third power or more; at most into
# so many parts.
NEAR_PATH, WANTED_NEAR_PATH, FINER_POWER, MOST_PARTS = 2e-7, 1e-7, 0.3, 8.0
# What control points give away of the cost, or what finer nodes save, is nothing [share].
GIVEN_AWAY = 1e-4
# Nodes of Newton's method: at most so many for each stretch of the path on which it is smooth.
MOST_NODES = 1024
# More of them are put in so often, at most.
NODE_ROUNDS = 14
# Where nodes keep bodies apart and the motion between them does not, they are kept so much farther
# apart at the points [m].
FARTHER_APART = (5e-4, 1e-3, 2e-3)
# What is asked of the ends is met to this [rad, rad/s].
ENDS_MET = 1e-8
# Steps of Newton's method from each of several beginnings: what takes longer mostly leads nowhere.
FEWER = 25
# Where the motion at x = 0 does not lead to what keeps the conditions: the self-motion goes towards
# the middle of the limits in such shares of the duration.
TOWARDS_MIDDLE = (1.0 / 16.0, 1.0 / 64.0, 1.0 / 4.0)
# And to either side of the start by so much along its self-motion, after this share of the
# duration; so many of these at most.
ASIDE, ASIDE_AFTER, MOST_ASIDE = (0.4, -0.4, 0.8, -0.8), 1.0 / 4.0, 4
# One towards the middle that breaks nothing comes before the motion at x = 0, where that breaks
# something and it costs no more than so many times as much: what costs more leads past bodies on
# the wrong side.
KEPT_FIRST = 1.5
# What would save less than this share of the cost does not bind.
LEAST_SAVING = 1e-6
# Between its nodes a motion may be off the path by this share of the tolerance where that is looked
# at, in the middle; and by this share of what it was before steps were halved.
RESOLVED = 0.3
FALLS = 0.7
# Limits that are exceeded between the nodes on more grids than this are so on any; and nothing is
# optimised again on grids with more than so many times the steps.
ROUGH_GRIDS = 3
FINER = 4

# --- long paths (postures)
# A path is long where the tool goes more than so many times the arm's reach: x = 0 begins to drift
# away. Of one that is longer than the second, rough motions from many starts tell nothing any more.
LONG_WAY, VERY_LONG_WAY = 5.0, 12.0
# What a stretch of it is long that tells the posture, likewise.
STRETCH_WAY = 2.0
# Nodes to begin with; the cost on them is right to this share.
FIRST_NODES, LONG_AGREEMENT = 64, 1e-2

# --- starts and chains (screening, starts, chains)
# Where nothing else leads to a motion that keeps the constraints, this many times more are tried.
SECOND_EFFORT = 4
# The shortest chain of a sequence becomes a motion of so many times its waypoints, with more where
# it does not keep the conditions between them, so often.
FINER_CHAIN = 3
CHAIN_ROUNDS = 4
# Sequences are not worth refining when dearer by this factor than one that keeps all constraints.
DEARER = 1.25
# The same where that is the chain of a sequence itself, on which optimising gains next to nothing.
DEARER_CHAIN = 1.005
# Steps of the rough motions.
ROUGH_STEPS = 12
# On nodes: steps of Newton's method.
ROUGH_ROUNDS = 30
# Rough optima on nodes whose costs differ by less than this share are worth the same; by less than
# the second, they are mirror images.
ABOUT_AS_GOOD, SAME_TO_DIGITS = 1e-2, 1e-9
# Of those that differ by less than this, the one nearest to home comes first [share].
AS_CHEAP = 1e-4
# So many rough motions at most; where conditions count, with so many steps more that know them.
ROUGH_MOTIONS, WITH_CONDITIONS = 16, 12
# Where a condition is not kept yet, each unit of it counts as so many times the cost.
UNKEPT = 10.0
# Motions at x = 0 that are this near at all times [rad or m] lie in one valley of the cost, as a
# rule; rough optima this near are the same.
ONE_VALLEY = 0.6
SAME_OPTIMUM = 0.1
# Evaluations of the cost that a damped motion may take, and each of many on parts of the path.
DAMPED_EVALUATIONS = 400
PART_EVALUATIONS = 150
# The same where the start is free: of many, the one that gets farthest needs no more, and who tries
# many places waits for it.
FREE_PART_EVALUATIONS = 30

# --- the largest part of a path
# Share of the time to the edge of the workspace that is given up, since joint speeds grow without
# bound towards it.
EDGE_MARGIN = 1e-4
# The end of the part is found to this share of it, and a part below this share of the path is none.
END_AGREEMENT = 1e-3
FREE_END_AGREEMENT = 4e-3
LEAST_PART = 1e-2
# Ends that are tried, at most; and where the start is free.
PROBES = 16
FREE_PROBES = 5
# Motions that are optimised, of all that are followed; these with so many steps, until they are off
# the path by this share of its extent.
PART_FINALISTS = 3
FOLLOWED_STEPS = 256
# Where the last bit of a part is too rough, parts that end by this share earlier, so often.
PART_BACK, SHORTER_PARTS = 0.02, 3
# Where the start is free: of so many starts, and in so many steps, only the best one.
PART_STARTS, FREE_FOLLOWED_STEPS = 16, 128
OFF_PATH = 1e-2
# Constant null motions that stand for x = 0 where that breaks down: joint angles over the path.
PUSHES = (0.5, 2.0)

# --- parts (parts)
# Where samples do not tell for sure how many parts are needed, a single motion is looked for before
# as many cuts.
MISSED_CUTS = 1
# Other cuts are tried where parts could not be planned, so often; they are so far away at least, as
# a share of the path's waypoints.
ATTEMPTS = 4
ELSEWHERE = 0.03
# A guide has at least so many samples.
GUIDE_SAMPLES = 13
# A retreat goes at this speed on average [m/s], and takes no less than this [s].
RETREAT_SPEED = 0.1
BRIEFEST_RETREAT = 0.5

# --- branches (branches)
# So many starts are looked at, and so many for each branch that is asked for, until so many have
# failed; plans from each take so many evaluations at most, and are the same where both their ends
# are as near as this [rad or m].
BRANCH_STARTS = 48
BRANCH_TRIES = 4
BRANCH_EVALUATIONS = 60
SAME_ENDS = 0.2


# --- the fastest motion
# After so many seconds the best so far has to do.
FASTEST_DEADLINE = 60.0
# Rounds end when one gains less than this share, or after so many.
ROUND_GAIN = 2e-3
ROUNDS = 8
# Costs that are to be kept and are not count as so many times the motion's time, then more.
KEPT_WEIGHT, KEPT_GROWTH = 0.05, 4.0
# The power of the cost: the larger, the nearer to the largest share, and the harder to minimise.
POWER = 16.0
# Intervals of the pace at which a round plans, and its degree.
COARSE = 32
DEGREE = 5
