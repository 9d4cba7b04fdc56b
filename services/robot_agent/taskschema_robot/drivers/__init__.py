"""Drivers: one small interface to an arm, whatever carries the commands."""
