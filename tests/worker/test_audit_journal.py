"""An audit that was stopped goes on with what it had counted, and ends with the same report."""

import pytest

from taskschema.errors import ConfigError
from taskschema.tasks.registry import get_task
from taskschema_worker.audit.audit import Effort, audit_with
from taskschema_worker.audit.journal import About, Journal, code_sha256
from taskschema_worker.audit.search import Search

ABOUT = About("opening", None, "tiny", 0, "c0de")
TINY = Effort(
    name="tiny",
    expert=2,
    corner=1,
    screen=1,
    confirm=2,
    random=8,
    idle_schemas=2,
    sample_schemas=1,
    search=Search(4, 1, 2),
    refine=Search(4, 1, 2),
)


class StoppedError(Exception):
    pass


def test_counts_are_made_once_and_read_again(tmp_path):
    path = tmp_path / "opening.md.parts"
    journal = Journal(path, ABOUT)
    assert journal.counts("expert", lambda: [7]) == [7]
    assert journal.counts("expert", lambda: pytest.fail("counted again")) == [7]
    journal.counts("search 3", lambda: (1, 2, 3))
    with path.open("ab") as file:
        file.write(b'{"part":"search 4","cou')  # where the power failed
    again = Journal(path, ABOUT)
    assert len(again) == 2
    assert again.counts("search 3", lambda: pytest.fail("counted again")) == [1, 2, 3]
    again.counts("search 4", lambda: [4])
    assert len(Journal(path, ABOUT)) == 3
    again.remove()
    assert not path.exists()


@pytest.mark.parametrize("change", [{"seed": 1}, {"effort": "full"}, {"task": "picking"}, {"code": "other"}])
def test_counts_of_anything_else_are_of_no_use(tmp_path, change):
    path = tmp_path / "parts"
    Journal(path, ABOUT).counts("expert", lambda: [7])
    assert len(Journal(path, changed(change))) == 0
    assert len(Journal(path, ABOUT)) == 0  # the file is about the other now


def changed(change):
    fields = {name: getattr(ABOUT, name) for name in About.__struct_fields__}
    return About(**(fields | change))


def test_a_place_that_cannot_be_written_is_said(tmp_path):
    with pytest.raises(ConfigError, match="cannot be written"):
        Journal(tmp_path / "nowhere" / "parts", ABOUT)


def test_the_code_s_hash_is_of_these_packages():
    assert code_sha256() == code_sha256()
    assert len(code_sha256()) == 64


@pytest.mark.timeout(300)
def test_an_audit_that_was_stopped_goes_on_to_the_same_report(tmp_path):
    task, path = get_task("lateral-lifting"), tmp_path / "parts"
    whole = audit_with(task, 0, TINY)

    def stop(part, share):
        if part == "one arm idle" and share > 0:
            raise StoppedError

    with pytest.raises(StoppedError):
        audit_with(task, 0, TINY, stop, journal=Journal(path, ABOUT))
    known = len(Journal(path, ABOUT))
    assert known > 3
    again = Journal(path, ABOUT)
    assert audit_with(task, 0, TINY, journal=again) == whole
    assert len(again) > known
