"""What the search looks at, and when it has enough: every number that decides what is found.

Rounding has its numbers where it occurs. What these do shows in `make suite` and `make suite-made`
(narrow passages, chains of many waypoints), `make bench-starts` (free starts against the best of
everything tried) and `make arms`. Where a figure was measured it stands here; the others were
chosen, and hold up in those.
"""

# --- curves: self-motions of one pose
# Largest distance of samples along a curve [rad or m], configuration norm.
SPACING = 0.1
# Longest single correction [rad or m]: a far start wanders where J is nearly singular.
LONGEST_CORRECTION = 0.5
# Corrections of a sample before its step is halved, and the share of the largest step below which
# a curve ends.
CORRECTIONS = 6
SMALLEST_STEP = 1.0 / 64.0
# Neighbours whose tangents differ by more than acos of this are too far apart to be trusted to
# lie on the same branch.
ALIGNED = 0.93
# A configuration this near [rad or m] to a curve's polyline is on the curve.
ON_CURVE = 0.02
# Samples after which a curve is given up.
MOST_SAMPLES = 5000
# Of the samples of a curve, every so manieth looks for the curve at the next waypoint.
CARRIED = 6
# Inverse kinematics starts anew at every so manieth waypoint, from so many seeds.
ANEW_EVERY = 10
ANEW_SEEDS = 100

# --- nodes: samples of curves that are inside the limits and free
# Where samples are free or not by turns, the border is enclosed to this share of the spacing.
BORDER = 0.25
# Carried samples nearer to each other than this share of the spacing are merged.
MERGED = 0.4
# Samples outside the limits by more than this [rad or m] before Newton's correction stay outside.
SURELY_OUTSIDE = 0.02

# --- samples: redundancy two and more
# Newton's steps onto the path, from near it and from anywhere.
NEAR_STEPS = 10
FAR_STEPS = 60
# Motions begin at so many times, evenly, from so many configurations each: of those that inverse
# kinematics finds from so many seeds.
BEGINNINGS = 7
BEGUN = 45
BEGINNING_SEEDS = 200
# Constant null motions drift so far over the whole path [rad or m], one standard deviation; every
# other motion has none.
DRIFT = 1.0
# Of the samples that a chain reaches, so many are followed to the next waypoint, those that are so
# far from each other [rad or m] first.
PARENTS = 80
PARENTS_APART = (1.6, 0.8, 0.4, 0.2, 0.1)
# So many tries around each of them, about this far off [rad].
STRAYS = 2
STRAYED = 0.15
# Around a chain, samples at these distances [rad or m], one after the other, so often each at most;
# a round that shortens the chain by less than this share is the last one of its ring.
RINGS = (0.3, 0.1, 0.03, 0.01)
RING_ROUNDS = 5
RING_GAIN = 5e-3

# --- shortest: chains of samples moved to where they are shortest
# δ, one stage after the other, as multiples of the chain's mean step; rounds of each at most, and
# the gain below which a stage ends.
SMOOTHINGS = (10.0, 3.0, 1.0, 0.3, 0.1)
# So many chains go through the first stage, after which it shows which are worth the others.
LOOKED_AT = 8
SHORTENING_ROUNDS = 20
SHORTENING_GAIN = 1e-3
# Rounds go so many times as far as their quadratics say, which are never below what they stand for.
FURTHER = 1.6
# No joint moves farther in a round than this [rad or m], and in the first one.
FARTHEST, FIRST_FARTHEST = 1.0, 0.5
# Joints as near to a limit as this [rad or m] stay there if they would leave it; rounds of that.
AT_LIMIT = 0.02
LIMITS_HELD = 4
# Steps are kept below this share of the largest; more counts as length times this [1/rad].
STEP_KEPT = 0.97
STEPS_STIFF = 30.0
# Bodies are kept apart by so much more than asked for [m]; less counts as length times this [1/m²].
NEAR_BODIES = 1e-4
BODIES_STIFF = 1e6

# --- chains: dynamic programming over the nodes
# Steps faster than this many times the mean speed of the shortest chain are changes from sample to
# sample, which the finished motion spreads over more time.
FAST = 2.0
# Layers whose kinematics are kept, per waypoint: memory, not what is found.
LAYERS_KEPT = 3
# Chains are unlike when some joint differs by this [rad or m] at this share of the waypoints.
UNLIKE = 0.3
UNLIKE_FOR = 0.1
# Mirror images have moved each joint by the same amount, up to this [rad or m].
SAME_TRAVEL = 0.2
# Chains looked at, mirror images included, before these have to do.
MOST_CHAINS = 60
# Nodes through which other chains are looked for: at so many waypoints, evenly.
STATIONS = 7
# What a change to another configuration counts: more than any motion in between.
BREAK = 1e6

# --- tightening: samples moved along their curves
# Distances of neighbouring samples [rad or m], each a third of the last, from half of that of the
# search on. A chain's excess length is about in proportion to the finest: 3 to 6 % at 0.01, 1 % at
# 0.003, and at 0.001 less than what smoothing the motion changes.
ROUGHLY = (0.03, 0.01)
FINELY = (0.003, 0.001)
# So many samples to each side are looked at in one round, in so many rounds at most; one that
# improves the chain by less than this share is the last one of its spacing.
SIDE = 6
TIGHTENING_ROUNDS = 40
TIGHTENING_GAIN = 2e-4

# --- guides: chains that motions start from
# Sequences refined; the best among the samples is not always that of the best motion.
REFINED = 3
# From one of the search's times to the next the tool moves by so much [m, rad], whatever the path's
# own waypoints: more times would take longer, and what comes of them is smoothed anyway.
STRIDE = 0.02
TURN = 0.1
# At fewer times than these a search would miss obstacles: self-motion curves allow for more than
# samples of larger spaces do in the same time. More would take too long.
FEWEST_OF_CURVES = 150
FEWEST = 60
MOST = 400
# The path is looked at so often to see how far the tool moves.
PATH_LOOKS = 2000
# What the sequences keep beyond the clearance asked for, since they are only checked at waypoints.
MARGIN = 2.5e-4
# Where the best chain itself is made the motion, it moves aside in the stages with the least δ, so
# far from limits [rad or m] and at this share of the largest speeds: between waypoints it bulges.
CHAIN_EDGE = 5e-4
CHAIN_SPEED = 0.95
# A node that does not come onto the path is put so far towards the next one; not in the middle,
# where a halved grid would have one of the same times again.
BESIDE = 0.3
LAST_SMOOTHINGS = (3.0, 1.0, 0.3, 0.1, 0.03)
# The jagged chain of samples is smoothed by a spline with this many of them per interval.
SMOOTHING = 3

# --- starts: configurations worth trying
# Solutions nearer than this [rad or m, Euclidean] lead to the same plan once the start may move.
SAME_START = 0.3
# Where all self-motions of the first pose can be traced: from so many seeds.
TRACING_SEEDS = 60
# Where they cannot: so many seeds for each configuration that is asked for.
TRIES = 2
# Where most of them do not keep what else is asked of a configuration: so many rounds of these at
# most, until there is this share of the starts.
START_ROUNDS, ENOUGH_STARTS = 12, 0.5

# --- reach: whether the arm can be there at all
# Poses along the path that are looked at, branches of solutions that are followed from one to the
# next, seeds where none of them goes on, and bisections of the time at which that happens.
POSES = 64
BRANCHES = 12
SEEDS = 24
BISECTIONS = 16
# Before a pose counts as out of reach, so many seeds more are tried, and a slower method from some:
# poses at joint limits are missed from 24. How far poses are out of reach is looked at for so many.
MORE_SEEDS = 300
LOOKS = 6
# Who gets so near [m + rad] counts as there.
NEARLY = 1e-5
# Poses about a time of trouble, in shares of the path's duration.
ABOUT = (-1e-3, 0.0, 1e-3, 4e-3)
# A singular value below this share of the dexterous configuration's counts as stretched or folded,
# a joint this near to its limit [rad or m] as at it.
STRETCHED = 0.1
AT_LIMIT = 1e-3

# --- single poses
# The slower method brings so many seeds nearer, in so many iterations each; and so many where a
# pose would be given up: near limits it arrives from a third of them, Newton's from one in 300.
APPROACHED, MORE_APPROACHED, ITERATIONS = 48, 400, 60
# For what is only proposed, so many do; and steps that gain less than this share of what is left,
# so often in turn, are the last ones: what arrives gains nearly all of it in each.
ROUGHLY_APPROACHED, LITTLE_GAIN, LITTLE_GAINS = 120, 1e-3, 5
# Of those that meet something, so many are looked at, and so many of these, which meet the least,
# moved aside at random, by less and less [rad].
MOST_LOOKED_AT, CLIMBERS = 80, 8
# Random walks along the self-motions, so many at a time, so often, in steps of these sizes [rad].
WALKERS, WALKS, WALK_STEPS = 64, 12, (0.1, 0.3, 0.8)
CLIMBS = (0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.05, 0.05, 0.02, 0.02)
# Poses along a path at which to look before anything else.
COARSE_POSES = 9

# --- remedies: what would help
# Seeds for each: so many of the nearest configurations, each so far off [rad], and some others;
# rounds in which a deviation has to be this share of the least before.
REMEDY_SEEDS, CLOSE = 8, (0.0, 0.03, 0.1, 0.3)
SHRINKS, SHRUNK = 6, 0.75
# A path is moved so often, each time a bit farther than needed at the pose where nothing was found,
# and no farther than this [m].
MOVE_TRIES, OVERSHOOT, FARTHEST = 4, 0.05, 0.5

# --- jumps: steps of chains that no motion takes
# A step is put onto the path in so many places, less one. What an arm can follow has no part that
# is more than this share of it, nor farther than this [rad or m].
JUMP_LOOKS, JUMP_SHARE, LEAST_JUMP = 8, 0.4, 0.05
# Chains are looked for again without the jumps they have, so often.
JUMP_ROUNDS = 12
