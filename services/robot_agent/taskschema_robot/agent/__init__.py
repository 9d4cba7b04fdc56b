"""The agent: leases one-episode slots, runs them on both arms through the gate, streams the trajectories."""
