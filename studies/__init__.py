"""Studies of learning, tasks and robots: each writes a table of `results/` or a figure of the docs."""
