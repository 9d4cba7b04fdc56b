"""`make compose-test`: the whole service in containers, disturbed, against the same run embedded.

Brings the stack up from nothing, scales it 2 -> 6 -> 1, kills the learner and a worker, restarts every
service, takes it down and up again, and asks for the schema all the while. It is stopped while its learner
is dead. In the end the run's hash must be
that of the same run embedded in the learner's image. The robot's twin, agent and training run beside it for
a while, and the stack's secrets are looked for wherever somebody may look. The commands of docs/deploy.md and
docs/operate.md are typed as they stand there, a backup and its restoration among them. Needs a Docker engine;
without one it says so.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.compose.commands import ask_the_tools, back_up, press_the_emergency_stop, restore_and_upgrade
from tests.compose.comparison import embedded_hash, finish
from tests.compose.ending import FAILURES, leave_in_order
from tests.compose.engine import SkippedError, compose_command
from tests.compose.monitoring import watch_with_prometheus
from tests.compose.schema_watch import SchemaWatch
from tests.compose.secrets_check import check_secrets_at_rest, check_secrets_of_running
from tests.compose.stack import (
    PROFILES,
    ROBOT_RUN,
    ROBOT_SLOTS,
    RUN,
    Stack,
    dangling_images,
    docker,
    image_sizes,
    remove_images,
)

TASK = "lateral-lifting"
KILL_ALL = ("sh", "-c", "kill -9 -1")
"""Every process of a container but its init dies at once; the engine's own `kill` would prevent a restart."""


def main() -> int:
    """Run the check and return the exit status."""
    try:
        compose = compose_command()
    except SkippedError as reason:
        print(f"compose-test: skipped: {reason}.")
        return 0
    leave_in_order("compose-test")
    with tempfile.TemporaryDirectory(prefix="compose-test-") as folder:
        stack = Stack(compose, Path(folder), TASK)
        stack.clean()
        dangling = dangling_images()
        started = time.monotonic()
        try:
            line = check(stack)
        except FAILURES as error:
            print(what_was_said(stack), file=sys.stderr)
            print(f"compose-test: FAILED: {type(error).__name__}: {error}")
            return 1
        finally:
            stack.clean()
            remove_images(dangling_images() - dangling)
    print(f"compose-test: passed in {(time.monotonic() - started) / 60:.1f} min: {line}")
    return 0


def what_was_said(stack: Stack) -> str:
    """Return the end of all logs, without the lines of rounds: they would push out why a service ended."""
    try:
        lines = stack.compose(*PROFILES, "logs", "--no-color").splitlines()
    except FAILURES as error:
        return f"The logs could not be read: {error}"
    return "\n".join([line for line in lines if "| round " not in line][-400:])


def check(stack: Stack) -> str:
    """Do everything and return what was measured, on one line."""
    build = timed(stack, *PROFILES, "build")
    up = timed(stack, "up", "-d", "--no-build", "--scale", "worker=2")
    up += stack.workers_become(2) + stack.rounds_pass(2)
    say(f"built in {build:.0f} s, two rounds after {up:.0f} s")
    say("images, beyond their base: " + ", ".join(f"{k} {v / 1e6:.0f} MB" for k, v in image_sizes().items()))
    say("memory: " + ", ".join(f"{name} {size}" for name, size in stack.memory().items()))
    with SchemaWatch(stack) as watch:
        grown = scale(stack, 6)
        stack.rounds_pass(1)
        shrunk = scale(stack, 1)
        learner_back = kill_processes(stack, "learner", RUN)
        worker_lost = kill_worker(stack)
        restart_everything(stack, watch)
        down_and_up(stack, watch)
        stack.post(f"/runs/{RUN}/pause")  # or its rounds meanwhile have to be made again, embedded
        twin = run_the_twin(stack)
        check_secrets_of_running(stack)
        stack.post(f"/runs/{RUN}/resume")
        stack.rounds_pass(1)
        prometheus = watch_with_prometheus(stack)
        say(f"watched with {prometheus}")
    assert not watch.failures, f"{len(watch.failures)} requests for the schema failed: {watch.failures[0]}"
    assert watch.versions == sorted(watch.versions), "an older schema was answered after a newer one"
    back_up(stack)
    end_processes(stack, "learner")  # a stop counts that is asked for while the engine starts it again
    rounds, here = finish(stack, {RUN: "learner", ROBOT_RUN: "robot-learner"})
    say(f"training {rounds} rounds embedded")
    there = embedded_hash(stack, TASK, rounds)
    assert here == there, f"the run's hash after {rounds} rounds is {here}, embedded it is {there}"
    stack.wait(lambda: stack.health("robot") == "running healthy", "a robot that waits for its learner")
    ask_the_tools(stack)
    restore_and_upgrade(stack, here, rounds)
    say("backed up while it trained, restored, trained to the same hash; built and started again")
    check_secrets_at_rest(stack)
    return (
        f"workers 2 -> 6 in {grown:.0f} s, 6 -> 1 in {shrunk:.0f} s; two rounds {learner_back:.0f} s after "
        f"the learner and {worker_lost:.0f} s after a worker was killed; schema answered {watch.answered} "
        f"times, slowest {1e3 * watch.slowest:.0f} ms, {watch.excused_failures} not answered while API or "
        f"Redis was restarted; {2 * ROBOT_SLOTS} episodes of the robot's twin learned from after "
        f"{twin:.0f} s; hash {here[:12]} after {rounds} rounds equals the embedded run's, and that of its "
        f"backup restored; watched with {prometheus}; no secret in images, processes, volumes and logs"
    )


def scale(stack: Stack, workers: int) -> float:
    """Change the number of worker containers; return how long until the pool has followed [s]."""
    seconds = timed(stack, "up", "-d", "--no-build", "--scale", f"worker={workers}") + stack.workers_become(
        workers
    )
    say(f"{workers} workers after {seconds:.0f} s")
    return seconds


def kill_processes(stack: Stack, service: str, run: str) -> float:
    """Kill all processes of a service's container; return how long two more rounds took [s]."""
    end_processes(stack, service)
    seconds = stack.rounds_pass(2, run)
    say(f"{service} killed: two rounds after {seconds:.0f} s")
    return seconds


def end_processes(stack: Stack, service: str) -> None:
    """Kill all processes of a service's one container."""
    (container,) = stack.containers(service)
    subprocess.run(["docker", "exec", container, *KILL_ALL], capture_output=True, timeout=60)


def kill_worker(stack: Stack) -> float:
    """Kill one of two worker containers for good; return how long two more rounds took [s]."""
    scale(stack, 2)
    docker("kill", stack.containers("worker")[-1])
    seconds = stack.rounds_pass(2)
    say(f"worker killed: two rounds after {seconds:.0f} s")
    stack.compose("up", "-d", "--no-build", "--scale", "worker=2")
    stack.workers_become(2)
    return seconds


def restart_everything(stack: Stack, watch: SchemaWatch) -> None:
    """Restart one service after the other; rounds go on after each."""
    for service in ("learner", "worker", "head"):
        stack.compose("restart", service)
        say(f"{service} restarted: next round after {stack.rounds_pass(1):.0f} s")
    for service in ("redis", "api"):
        with watch.excused():
            stack.compose("restart", service)
        say(f"{service} restarted: next round after {stack.rounds_pass(1):.0f} s")


def down_and_up(stack: Stack, watch: SchemaWatch) -> None:
    """Take everything down but the volumes, and up again: the run goes on where it was."""
    before = stack.version()
    with watch.excused():
        down = timed(stack, "down")
        up = timed(stack, "up", "-d", "--no-build", "--scale", "worker=2")
    assert stack.version() >= before, f"version {stack.version()} after down and up, {before} before"
    say(f"down took {down:.0f} s, up {up:.0f} s: next round after {stack.rounds_pass(1):.0f} s")


def run_the_twin(stack: Stack) -> float:
    """Start the robot's profile beside the rest; return how long its first two rounds took [s].

    Then its twin is restarted, stopped for a while, and killed, the agent killed and restarted, too, and the
    learner restarted: they find each other again.
    """
    seconds = timed(stack, "--profile", "robot", "up", "-d", "--no-build", "robot")
    seconds += stack.rounds_pass(2, ROBOT_RUN)
    say(f"two rounds of the robot's twin after {seconds:.0f} s")
    assert stack.live_workers(ROBOT_RUN) == 1
    profile = ("--profile", "robot")
    stack.compose(*profile, "restart", "robot-twin")
    say(f"robot-twin restarted: two rounds after {stack.rounds_pass(2, ROBOT_RUN):.0f} s")
    starts = stack.engine_starts("robot")
    stack.compose(*profile, "stop", "robot-twin")
    stack.wait(lambda: stack.engine_starts("robot") > starts, "a robot that starts without its twin")
    stack.compose(*profile, "start", "robot-twin")
    say(f"robot-twin stopped and started: two rounds after {stack.rounds_pass(2, ROBOT_RUN):.0f} s")
    for service in ("robot-twin", "robot"):
        kill_processes(stack, service, ROBOT_RUN)
    for service in ("robot", "robot-learner"):
        stack.compose(*profile, "restart", service)
        say(f"{service} restarted: next round after {stack.rounds_pass(1, ROBOT_RUN):.0f} s")
    say(f"emergency stop pressed and released: next round after {press_the_emergency_stop(stack):.0f} s")
    return seconds


def timed(stack: Stack, *words: str) -> float:
    """Run a compose command and return how long it took [s]."""
    started = time.monotonic()
    stack.compose(*words)
    return time.monotonic() - started


def say(line: str) -> None:
    print(f"  {line}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
