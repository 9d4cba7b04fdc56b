"""What a learner does not let in: kept, counted, charged to its slot, never returned."""

import msgspec
import numpy as np
import pytest
from bus_setup import Run, deliver, encoded, gather, some_trajectories, toy_snapshot
from hypothesis import given, settings
from hypothesis import strategies as st

from taskschema.bus.admission import DATA, HEADER, Admission, RefusedError
from taskschema.bus.learner_bus import LearnerBus
from taskschema.config import PROTOCOL_VERSION, RunConfig
from taskschema.errors import QuarantineLimitError
from taskschema.tasks.toy import Toy
from taskschema.trajectory import MAX_MESSAGE_BYTES, Trajectory, TrajectoryFormat, encode_slot

SNAPSHOT = toy_snapshot(2)


def altered(**changes: object) -> bytes:
    """Slot 3 of round 2 with its first episode changed."""
    first, *rest = some_trajectories(3, 2)
    return encode_slot([Trajectory(**{**vars(first), **changes}), *rest])


def with_nan() -> bytes:
    observations = some_trajectories(3, 2)[0].observations.copy()
    observations[1, 2] = np.nan
    return altered(observations=observations)


GOOD = encode_slot(some_trajectories(3, 2))

BAD_DATA = {
    "noise": (b"\x00\xff not msgpack", "malformed"),
    "empty": (b"", "malformed"),
    "truncated": (GOOD[:-7], "malformed"),
    "oversized": (b"\x00" * (MAX_MESSAGE_BYTES + 1), "oversized"),
    "not finite": (with_nan(), "not_finite"),
    "huge arguments": (altered(arguments=np.full((3, 6), 3e38, dtype=np.float32)), "malformed"),
    "wrong width": (altered(observations=np.zeros((3, 5), dtype=np.float32)), "malformed"),
    "wrong precision": (altered(observations=np.zeros((3, Toy().observation.size))), "malformed"),
    "unknown pair": (altered(pairs=np.array([0, 9, 0])), "malformed"),
    "too few episodes": (encode_slot(some_trajectories(3, 2)[:3]), "malformed"),
    "another slot's": (encode_slot(some_trajectories(4, 2)), "malformed"),
    "another round's": (encode_slot(some_trajectories(3, 1)), "malformed"),
}

BAD_HEADERS = {
    "later round": ({"round": 3}, "wrong_round"),
    "unknown slot": ({"slot": 8}, "unknown_slot"),
    "foreign config": ({"config_hash": "0" * 64}, "foreign_config"),
    "foreign protocol": ({"protocol": PROTOCOL_VERSION + 1}, "foreign_protocol"),
    "foreign policy": ({"policy_sha256": "0" * 64}, "foreign_policy"),
    "negative slot": ({"slot": -1}, "malformed"),
    "huge round": ({"round": 2**70}, "malformed"),
    "no hash": ({"policy_sha256": "nothing"}, "malformed"),
    "long name": ({"worker": "w" * 5_000}, "oversized"),
}


@pytest.fixture
def learner(run: Run) -> LearnerBus:
    bus = run.learner()
    bus.open_round(2, SNAPSHOT, range(8))
    return bus


def check_refused(run: Run, learner: LearnerBus, kind: str) -> None:
    assert learner.results(1.0) == []
    assert run.records.quarantine_counts(run.name) == {kind: 1}
    assert learner.quarantined == 1
    (kept,) = run.client.xrange(run.keys.quarantine)
    assert kept[1][b"kind"].decode() == kind
    assert kept[1][b"reason"]
    assert len(kept[1][b"data"]) <= 4_096
    assert run.client.xlen(run.keys.trajectories) == 0
    assert deliver(run.worker()) == list(range(8)), "every slot is still there to be run, once"
    assert encoded(gather(learner, 8)) == {slot: encode_slot(some_trajectories(slot, 2)) for slot in range(8)}


@pytest.mark.parametrize("name", BAD_DATA)
def test_bad_data(run: Run, learner: LearnerBus, name: str) -> None:
    data, kind = BAD_DATA[name]
    run.send(run.header(3, SNAPSHOT), data)
    check_refused(run, learner, kind)


@pytest.mark.parametrize("name", BAD_HEADERS)
def test_bad_header(run: Run, learner: LearnerBus, name: str) -> None:
    changes, kind = BAD_HEADERS[name]
    run.send(msgspec.structs.replace(run.header(3, SNAPSHOT), **changes), GOOD)
    check_refused(run, learner, kind)


def test_slot_that_its_worker_could_not_see(run: Run, learner: LearnerBus) -> None:
    run.send(msgspec.structs.replace(run.header(3, SNAPSHOT), bad_frame="frame 0 is black"), b"")
    check_refused(run, learner, "bad_frame")
    run.send(msgspec.structs.replace(run.header(3, SNAPSHOT), bad_frame="frame 1 is black"), b"")
    assert learner.results(1.0) == []
    assert run.open_slots() == [], "somebody else has delivered it: it is not run again"


def test_what_is_wrong_with_a_frame_is_one_short_line(run: Run, learner: LearnerBus) -> None:
    for words in ("two\nlines", "a line's end\n", "x" * 501):
        run.send(msgspec.structs.replace(run.header(3, SNAPSHOT), bad_frame=words), b"")
    assert learner.results(1.0) == []
    assert run.records.quarantine_counts(run.name) == {"malformed": 3}


def test_whoever_goes_on_after_the_third_refusal_starts_to_count_again(run: Run, learner: LearnerBus) -> None:
    for _ in range(3):
        for slot in (5, 6):
            run.send(msgspec.structs.replace(run.header(slot, SNAPSHOT), bad_frame="it is black"), b"")
    with pytest.raises(QuarantineLimitError, match=r"Slot 5 .* 3 times.*it is black\. Mend the"):
        learner.results(1.0)
    successor = run.learner()
    successor.open_round(2, SNAPSHOT, range(8))
    assert deliver(run.worker()) == list(range(8))
    assert len(gather(successor, 8)) == 8


@pytest.mark.parametrize("header", [b"", b"{}", b"[1]", b"\xff\xfe", b'{"round":' * 400, b"null"])
def test_header_that_is_none(run: Run, learner: LearnerBus, header: bytes) -> None:
    run.send(header, GOOD)
    check_refused(run, learner, "malformed")


def test_entry_of_other_fields(run: Run, learner: LearnerBus) -> None:
    run.client.xadd(run.keys.trajectories, {"anything": "else"})
    check_refused(run, learner, "malformed")


def test_good_neighbours_of_bad_entries_come_in(run: Run, learner: LearnerBus) -> None:
    run.send(run.header(0, SNAPSHOT), encode_slot(some_trajectories(0, 2)))
    run.send(b"junk", b"junk")
    run.send(run.header(1, SNAPSHOT), encode_slot(some_trajectories(1, 2)))
    assert sorted(encoded(gather(learner, 2))) == [0, 1]


def test_duplicates_are_counted_and_applied_once(run: Run, learner: LearnerBus) -> None:
    deliver(run.worker())
    run.send(run.header(3, SNAPSHOT), GOOD)
    run.send(run.header(3, SNAPSHOT), altered(physics_steps=7))
    run.send(msgspec.structs.replace(run.header(3, SNAPSHOT), policy_sha256="0" * 64), GOOD)
    results = gather(learner, 8)
    assert learner.results(0.1) == []
    assert encoded(results)[3] == GOOD
    assert len(results) == 8
    assert run.records.quarantine_counts(run.name) == {
        "different_duplicate": 1,
        "duplicate": 1,
        "foreign_policy": 1,
    }
    assert run.client.hlen(run.keys.refusals) == 0, "no slot has to be run again"


def test_refused_slot_is_leased_again_and_the_third_time_stops_the_run(run: Run, learner: LearnerBus) -> None:
    worker = run.worker()

    def submit_bad_slot_5() -> list[int]:
        leases = worker.lease(1)
        results = [(lease, some_trajectories(lease.item.slot, 2)) for lease in leases]
        for lease, trajectories in results:
            if lease.item.slot == 5:
                trajectories[1].arguments[0, 0] = np.inf
        worker.submit(results)
        return [lease.item.slot for lease in leases]

    assert submit_bad_slot_5() == list(range(8))
    assert len(gather(learner, 7)) == 7
    assert submit_bad_slot_5() == [5]
    assert learner.results(1.0) == []
    assert submit_bad_slot_5() == [5]
    with pytest.raises(QuarantineLimitError, match=r"Slot 5 of round 2 was refused 3 times.*not finite"):
        learner.results(1.0)
    assert run.records.quarantine_counts(run.name) == {"not_finite": 3}


def test_refusals_are_remembered_by_the_next_learner(run: Run, learner: LearnerBus) -> None:
    for _ in range(2):
        run.send(run.header(5, SNAPSHOT), b"junk")
        learner.results(1.0)
    successor = run.learner()
    successor.open_round(2, SNAPSHOT, range(8))
    run.send(run.header(5, SNAPSHOT), b"junk")
    with pytest.raises(QuarantineLimitError, match="Slot 5 of round 2"):
        successor.results(1.0)


def test_slot_whose_result_does_not_even_name_it_is_charged(run: Run, learner: LearnerBus) -> None:
    """A worker that writes bad headers takes work and gives nothing back: that must end, too."""
    deliver(run.worker())
    gather(learner, 8)
    learner.open_round(2, toy_snapshot(2, seed=1), [6])

    def swallow_slot_6() -> None:
        run.client.xtrim(run.keys.work, 0)
        run.send(b"junk", b"junk")

    for _ in range(2):
        swallow_slot_6()
        learner.results(1.0)
    swallow_slot_6()
    with pytest.raises(QuarantineLimitError, match="Slot 6 of round 2"):
        learner.results(1.0)


def test_quarantine_is_bounded(run: Run, learner: LearnerBus) -> None:
    run.client.xadd(run.keys.quarantine, {"old": "entry"})
    with run.client.pipeline() as pipe:
        for _ in range(1_500):
            pipe.xadd(run.keys.quarantine, {"kind": "malformed"})
        pipe.execute()
    run.send(b"junk", b"junk")
    learner.results(1.0)
    assert 1_000 <= run.client.xlen(run.keys.quarantine) <= 1_200


def test_inherited_junk_does_not_keep_a_round_from_opening(run: Run) -> None:
    run.send(b"junk", b"junk")
    run.send(run.header(0, SNAPSHOT), encode_slot(some_trajectories(0, 2)))
    learner = run.learner()
    learner.open_round(2, SNAPSHOT, range(8))
    assert learner.missing == list(range(1, 8))
    assert learner.quarantined == 1


CONFIG_HASH = RunConfig(task="toy").config_hash
HEADER_TEXT = {
    "protocol": 1,
    "config_hash": CONFIG_HASH,
    "round": 2,
    "slot": 3,
    "policy_sha256": SNAPSHOT.sha256,
    "worker": "w",
}
anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@settings(max_examples=300, deadline=None)
@given(
    header=st.binary(max_size=200)
    | st.builds(
        lambda name, value: msgspec.json.encode(HEADER_TEXT | {name: value}),
        st.sampled_from([*HEADER_TEXT, "bad_frame", "extra"]),
        anything,
    ),
    data=st.binary(max_size=200) | st.just(GOOD),
)
def test_admission_lets_in_or_refuses_but_never_fails(header: bytes, data: bytes) -> None:
    door = Admission(
        2, range(8), SNAPSHOT.sha256, CONFIG_HASH, TrajectoryFormat.of(Toy(), RunConfig(task="toy"))
    )
    try:
        result = door.admit({HEADER: header, DATA: data})
    except RefusedError as error:
        result, reason = None, str(error)
    else:
        reason = ""
    assert "\n" not in reason
    assert door.missing == [slot for slot in range(8) if result is None or slot != result.slot]
    assert result is None or data == GOOD
