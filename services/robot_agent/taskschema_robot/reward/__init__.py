"""The automatic reward: printed markers, seen from above, say success, failure or unknown."""
