"""The toy task at a pace at which a process can be killed in the middle of a round."""

import time

from taskschema.tasks.toy import Toy, ToyEnvironment


class SlowEnvironment(ToyEnvironment):
    def step(self, episodes, pairs, arguments):
        time.sleep(0.002 * len(episodes))
        return super().step(episodes, pairs, arguments)


class SlowToy(Toy):
    def make_environment(self, threads: int = 1):
        return SlowEnvironment(self)
