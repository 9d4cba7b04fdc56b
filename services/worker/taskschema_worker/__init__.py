"""Rollout workers: scenes, simulation, gymnasium environments and the rollout loop."""
