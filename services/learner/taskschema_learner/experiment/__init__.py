"""Experiments: matrices of trainings that can be stopped and resumed, with their tables and figures."""
