"""Names of everything that a run keeps in Redis."""

import re
from dataclasses import dataclass

from taskschema.errors import ConfigError

RUNS = "taskschema:runs"
"""Set of the names of all runs."""
GROUP = "agents"
"""Consumer group of the work stream."""

_RUN_NAME = re.compile(r"[a-z0-9][a-z0-9._-]{0,62}")


@dataclass(frozen=True)
class RunKeys:
    """Keys of one run.

    The run's name is a hash tag: all keys of a run live on one node of a cluster, as transactions need.

    Raises:
        ConfigError: if the name cannot be a run's.

    """

    run: str

    def __post_init__(self) -> None:
        if not _RUN_NAME.fullmatch(self.run):
            raise ConfigError(
                f"Run name {self.run[:80]!r} cannot be used: take 1 to 63 lower-case letters, digits, dots, "
                "dashes or underscores, a letter or digit first."
            )

    def _key(self, name: str) -> str:
        return f"taskschema:{{{self.run}}}:{name}"

    @property
    def all(self) -> tuple[str, ...]:
        """Every key of the run."""
        records = (self.config, self.status, self.request, self.target, self.policy, self.schemas, self.curve)
        agents = (self.workers, self.heartbeats, self.agent_kind, self.leases)
        return (
            *records,
            *agents,
            self.fence,
            self.work,
            self.trajectories,
            self.quarantine,
            self.quarantine_counts,
            self.refusals,
            self.counters,
        )

    @property
    def config(self) -> str:
        """Hash: config, its hash and the protocol version."""
        return self._key("config")

    @property
    def status(self) -> str:
        """Hash: what the run is doing."""
        return self._key("status")

    @property
    def request(self) -> str:
        """String: what somebody asked the learner to do."""
        return self._key("request")

    @property
    def target(self) -> str:
        """String: how many workers somebody asked for."""
        return self._key("target")

    @property
    def policy(self) -> str:
        """Hash: version, sha256 and safetensors bytes of the newest policy."""
        return self._key("policy")

    @property
    def schemas(self) -> str:
        """Hash: schema documents by version, and `current`."""
        return self._key("schemas")

    @property
    def curve(self) -> str:
        """Stream: one entry per round, whose id is the policy version."""
        return self._key("curve")

    @property
    def workers(self) -> str:
        """Hash: what each agent says about itself."""
        return self._key("workers")

    @property
    def heartbeats(self) -> str:
        """Sorted set: agents by their latest sign of life, in the server's time [s]."""
        return self._key("heartbeats")

    @property
    def leases(self) -> str:
        """Hash: what agents count about their leases, all together (`taskschema.bus.counters`)."""
        return self._key("leases")

    @property
    def counters(self) -> str:
        """Hash: what the learner counts about its rounds (`taskschema.bus.counters`)."""
        return self._key("counters")

    @property
    def agent_kind(self) -> str:
        """String: the kind of agent that serves the run."""
        return self._key("agent-kind")

    @property
    def fence(self) -> str:
        """String: the newest learner's fencing token."""
        return self._key("fence")

    @property
    def work(self) -> str:
        """Stream: slots to run; entries stay until a checkpoint covers their results."""
        return self._key("work")

    @property
    def trajectories(self) -> str:
        """Stream: results of slots."""
        return self._key("trajectories")

    @property
    def quarantine(self) -> str:
        """Stream, bounded: messages that were refused, with their reasons."""
        return self._key("quarantine")

    @property
    def quarantine_counts(self) -> str:
        """Hash: how many messages were refused, by kind of reason."""
        return self._key("quarantine-counts")

    @property
    def refusals(self) -> str:
        """Hash: how often each slot of the open round was refused."""
        return self._key("refusals")
