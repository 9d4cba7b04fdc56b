"""What a session does with what it has leased, and how it ends: nothing is lost, nothing wrongly counted."""

import threading

import pytest
from agent_setup import CONFIG, AgentBench, ScriptedWorld, open_round
from bus_setup import Run, gather
from hands_in_the_air import TOOK_AT, InTheAir, heights

from taskschema.bus.messages import WorkItem
from taskschema.errors import BusError
from taskschema_robot.agent.robot_agent import MOST_ATTEMPTS
from taskschema_robot.agent.world import NobodyThereError, SessionEndedError
from taskschema_robot.reward.judge import Judgement, Outcome

UNKNOWN = Judgement(Outcome.UNKNOWN, "hidden")


@pytest.fixture
def run(shared_redis):
    with Run(shared_redis.url, CONFIG) as fresh:
        yield fresh


@pytest.fixture
def bench(run, tmp_path):
    made = AgentBench(run, tmp_path)
    yield made
    made.leave()


def raising(bench: AgentBench, *errors: Exception) -> None:
    """Have as many resets fail."""
    waiting = list(errors)

    def on_reset() -> None:
        if waiting:
            raise waiting.pop(0)

    bench.world.on_reset = on_reset


def test_what_was_leased_is_served_after_redis_was_away(run, bench):
    learner, _ = open_round(run)
    submit, failures = bench.bus.submit, [BusError("Redis does not answer.")]

    def fail_once(results) -> None:
        if failures:
            raise failures.pop()
        submit(results)

    bench.bus.submit = fail_once
    bench.serve(3, seconds=20.0)
    assert {result.slot for result in gather(learner, 3)} == {0, 1, 2}
    assert bench.world.resets == 3


def test_tries_of_earlier_sessions_block_no_slot(run, bench):
    learner, snapshot = open_round(run)
    for slot in range(CONFIG.slots):
        for _ in range(MOST_ATTEMPTS):
            bench.agent._log.drop(WorkItem(0, slot, snapshot.sha256))
    bench.serve(3)
    assert {result.trajectories[0].attempt for result in gather(learner, 3)} == {MOST_ATTEMPTS}


def test_an_agent_alone_with_its_key_waits_and_charges_nobody(run, bench):
    learner, _ = open_round(run)
    raising(bench, *[NobodyThereError("Nobody held the key.")] * (MOST_ATTEMPTS + 5))
    bench.serve(3)
    assert {result.trajectories[0].attempt for result in gather(learner, 3)} == {0}
    assert len(bench.operator.drops) == MOST_ATTEMPTS + 5
    assert bench.agent.progress.dropped == 0


def test_a_person_who_ends_at_the_reset_prompt_is_not_charged(run, bench):
    open_round(run)
    raising(bench, SessionEndedError("A person ended the session."))
    bench.agent.run(threading.Event())
    assert bench.world.resets == 1
    assert bench.agent.progress.dropped == 0
    assert bench.operator.drops == []
    assert not list(bench.agent._log._folder.glob("*.attempts"))


def test_a_session_that_is_to_end_begins_no_other_try(run, bench):
    open_round(run)
    stop = threading.Event()
    bench.world.on_reset = stop.set
    bench.world.object_pose = lambda: None  # the episode is dropped for that
    bench.agent.run(stop)
    assert bench.world.resets == 1
    assert bench.agent.progress.dropped == 1


def test_nothing_stays_in_the_air_when_a_session_ends(bench):
    in_the_air = InTheAir(0.3, 0.3)
    bench.agent._runner = in_the_air.runner
    stop = threading.Event()

    def end(progress, key) -> None:
        raise SessionEndedError("A person ended the session.")

    bench.operator.begin = end
    lowest: list[float] = []
    home = in_the_air.runner.go_home

    def go_home() -> None:
        lowest.append(max(heights(in_the_air.bench.positions())))
        home()

    in_the_air.runner.go_home = go_home
    assert bench.agent._perform(WorkItem(0, 0, "0" * 64), None, stop) is None
    assert stop.is_set()
    assert lowest == [pytest.approx(TOOK_AT, abs=0.01)]


@pytest.mark.parametrize("said", list(Outcome))
def test_what_is_hidden_in_the_air_is_asked_about_before_it_is_put_down(said):
    world = ScriptedWorld(answers=[said])
    in_the_air, asked_at = InTheAir(0.4, 0.4, world=world), []
    world.on_ask = lambda: asked_at.extend(heights(in_the_air.bench.positions()))
    assert in_the_air.runner._end(None, UNKNOWN, "").outcome is said
    assert asked_at == pytest.approx([0.4, 0.4], abs=0.01)
    assert world.last_looks == 0, "it was judged where it was put down"


def test_what_is_hidden_on_the_table_is_looked_at_again():
    world = ScriptedWorld(looks=[Outcome.SUCCESS])
    on_the_table = InTheAir(TOOK_AT, TOOK_AT, world=world)
    assert on_the_table.runner._end(None, UNKNOWN, "").outcome is Outcome.SUCCESS
    assert (world.asked, world.last_looks) == (0, 1)
