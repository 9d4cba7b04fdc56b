"""Films of episodes: a run's, or a task's scripted expert's, with the names of the skills written in."""
