"""Rollout actors on Ray."""
