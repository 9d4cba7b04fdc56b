"""What a check of a set-up found."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One item of a check."""

    what: str
    good: bool
    words: str
    """What was found, and what to do if it is not good."""
