"""A run on disk: its folder, checkpoints and hashes, and computing it again."""
