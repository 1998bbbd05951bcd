"""Uses of plans: jobs, batches, margins, placement."""
