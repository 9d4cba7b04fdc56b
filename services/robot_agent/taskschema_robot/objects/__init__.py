"""The nine objects of the paper's real experiments (Table I), as frozen configuration."""
