"""The agent that drives two real arms."""
