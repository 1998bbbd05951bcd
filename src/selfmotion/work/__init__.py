"""What is done with plans: jobs, batches, margins, placement."""
