"""Models: task, robot, path, task frames, motions, bodies, and compiled algebra."""
