"""The commands that a page of the docs shows, read from the page."""

import re

from tests.compose.engine import ROOT


def script(page: str, heading: str) -> str:
    """Return the first block of commands below a heading, as it stands there.

    Raises:
        LookupError: if there is none.
    """
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    match = re.search(
        rf"^#+ {re.escape(heading)}\n(?:(?!#)[^\n]*\n)*?```(?:sh)?\n(.*?)```", text, re.M | re.S
    )
    if match is None:
        raise LookupError(f"docs/{page} shows no commands below {heading!r}.")
    return match[1]


def commands(page: str) -> list[str]:
    """Return every command of a page, without comments, each on one line."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```(\w*)\n(.*?)^```", text, re.M | re.S)
    lines = "\n".join(block for kind, block in blocks if kind in ("", "sh")).replace("\\\n", " ").splitlines()
    bare = [re.sub(r"\s+#.*", "", re.sub(r"\s+", " ", line)).strip() for line in lines]
    return [line for line in bare if line]
