"""docs/scale.md: its tables are those of the committed parts, and there always is a limit."""

import pytest
from bench import growth, learner_memory
from bench.cluster_needs import limits, needs, paces, section
from bench.presence import BEATING, measure
from bench.report import SCALE, with_section
from bench.saturation import sample_message

PARTS = growth.Parts(
    rollout_seconds={1: 0.1},
    update_seconds={50: 0.05, 100: 0.1},
    intake_seconds=0.001,
    redis_seconds=0.0001,
    message_bytes=4000,
)
PRESENCE = growth.Presence(
    beat_seconds=0.0001,
    ask_seconds={50: 0.001, 500: 0.001, 5000: 0.002},
    ask_bytes={50: 100.0, 500: 100.0, 5000: 100.0},
    policy_bytes=60_000,
    learner_bytes={50: 2**29, 500: 2**30, 5000: 2**31},
)
CONTAINERS = growth.Containers(workers=50, worker_bytes=2**28, head_bytes=2**30)


def row(name: str) -> list[str]:
    (line,) = [line for line in needs(PARTS, PRESENCE, CONTAINERS) if line.startswith(f"| {name} |")]
    return [word.strip() for word in line.split("|")[2:-1]]


def test_the_page_is_that_of_the_committed_parts():
    page = SCALE.read_text(encoding="utf-8")
    assert page == with_section(page, section(growth.read())), "run `python -m bench.report`"


def test_what_workers_need():
    # 500 slots: an intake of 0.5 s and, beyond 100 slots in proportion, an update of 0.5 s.
    assert row("seconds a round") == ["0.15", "1.00", "10.00"]
    assert row("episodes per second") == ["1,333", "2,000", "2,000"]
    assert row("of a round: learner takes results in") == ["33%", "50%", "50%"]
    assert row("Redis: one core's time for signs of life") == ["0.5%", "5.0%", "50.0%"]
    # Idle ones ask all together once in 20 ms, but each at least every 10 s: 50, 50 and 500 times a second.
    assert row("Redis: one core's time for asking, all idle") == ["5.0%", "5.0%", "100.0%"]
    assert row("memory: all workers, a container each [GiB]") == ["12", "125", "1,250"]
    assert row("memory: learner, at most [GiB]") == ["0.50", "1.00", "2.00"]
    assert row("memory: Ray's head [GiB]") == ["1.00", "not measured", "not measured"]


def test_there_is_a_limit_though_the_update_never_takes_half_of_a_round():
    # A round of n slots takes max(0.1, 0.001 n) + 0.0004 n: from 100 workers on, each slot 1.4 ms.
    parts = growth.Parts({1: 0.1}, {50: 0.02, 100: 0.04}, 0.001, 0.0001, 4000)
    assert growth.predict(parts, 5_000, 5_000).learner_share < 0.5
    # Twice 60 workers make 120 / 0.168 against 60 / 0.124 slots a second: 1.48 times as many; 50: 1.71 times.
    (line,) = limits(parts)
    assert "up to some 60 workers" in line
    assert "From 100 workers on" in line


def test_what_500_workers_wait_for():
    # A slot of 4 episodes takes 0.1 s, 500 of them 0.5 s to take in and 5 x 0.1 s to update with.
    # One worker makes 4 / 0.1 episodes a second, the intake takes 4 / 0.001.
    (line,) = paces(PARTS)
    assert "a worker 0.10 s, 25 ms an episode" in line
    assert "500 slots takes the learner 0.50 s to take in and 0.50 s to update with" in line
    assert "run 1 slots as one batch fill its intake when they are 100." in line


@pytest.mark.timeout(600)
def test_presence_is_measured_with_a_real_redis():
    found = measure(workers=(2, 40), seconds=1.0)
    assert 0 < found.beat_seconds < 1 / BEATING
    assert set(found.ask_seconds) == set(found.ask_bytes) == set(found.learner_bytes) == {2, 40}
    assert found.policy_bytes > 10_000


@pytest.mark.timeout(600)
def test_a_learner_of_more_slots_needs_more_memory():
    message = sample_message()
    few, many = (learner_memory.measure(message, slots) for slots in (10, 2_000))
    assert 50e6 < few < many
