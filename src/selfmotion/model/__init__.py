"""What there is: task, robot, path, what follows it, motions, bodies, and compiled algebra."""
