"""The table of many objects says what the trainings came to, and nothing about what is not known."""

from studies.many_objects import FROM_SCRATCH, TRANSFERRED, Row, page, read_rows, write


def row(thing, way, seed, episodes, solved=True):
    return Row(
        thing=thing,
        way=way,
        seed=seed,
        solved=solved,
        episodes=episodes,
        minutes=1.0,
        success_last_100=0.9 if solved else 0.1,
        sha256="a",
        commit="b",
    )


ROWS = [
    row("box", TRANSFERRED, 0, 2_000),
    row("box", TRANSFERRED, 1, 4_000),
    row("box", FROM_SCRATCH, 0, 9_000),
    row("tray", TRANSFERRED, 0, 3_000),
    row("tray", FROM_SCRATCH, 0, 40_000, solved=False),
]


def test_the_table_holds_medians_and_their_ratio():
    lines = page(ROWS).splitlines()
    assert "| box | transferred | 2,000 | 4,000 | 3,000 |  |" in lines
    assert "| box | from scratch | 9,000 | - | 9,000 | 3.0 |" in lines  # 9,000 / 3,000
    assert "| tray | from scratch | > 40,000 | - | - |  |" in lines
    assert "| rolling pin | transferred | - | - | - |  |" in lines


def test_what_was_written_is_read_again(tmp_path):
    rows = {item.key: item for item in ROWS}
    assert read_rows(tmp_path) == {}
    write(tmp_path, rows)
    assert read_rows(tmp_path) == rows
    assert (tmp_path / "README.md").read_text() == page([rows[key] for key in sorted(rows)])
