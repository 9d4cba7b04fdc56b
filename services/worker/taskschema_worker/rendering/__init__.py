"""Pictures of the simulation, drawn off screen with or without a GPU."""
