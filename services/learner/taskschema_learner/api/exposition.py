"""Facts about runs as Prometheus metrics, read from the source whenever they are scraped."""

from collections.abc import Iterator

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector

from taskschema.errors import TaskschemaError
from taskschema.metrics import RoundMetrics
from taskschema_learner.api.source import RunSource

STATES = ("starting", "running", "paused", "finished", "stopped", "failed")


def exposition(source: RunSource) -> bytes:
    """Return all metrics in Prometheus' text format; `taskschema_source_up` is 0 if runs cannot be read."""
    registry = CollectorRegistry()
    ProcessCollector(namespace="taskschema_api", registry=registry)
    registry.register(RunCollector(source))
    return generate_latest(registry)


class RunCollector(Collector):
    """Reads every run once and yields its metrics."""

    def __init__(self, source: RunSource) -> None:
        self._source = source

    def describe(self) -> list[Metric]:
        """Return nothing: the names depend on what there is to read."""
        return []

    def collect(self) -> Iterator[Metric]:
        """Read and yield."""
        up = GaugeMetricFamily("taskschema_source_up", "Whether the API can read runs (Redis is reachable).")
        families = _Families()
        try:
            for run in self._source.runs():
                self._read(run, families)
        except TaskschemaError:
            up.add_metric([], 0)
            yield up
            return
        up.add_metric([], 1)
        yield up
        yield from families.all()

    def _read(self, run: str, families: "_Families") -> None:
        status = self._source.status(run)
        for state in STATES:
            families.state.add_metric([run, state], float(status.state == state))
        families.live_workers.add_metric([run], len(self._source.workers(run)))
        target = self._source.worker_target(run)
        if target is not None:
            families.target.add_metric([run], target)
        for reason, count in self._source.quarantine(run).items():
            families.quarantined.add_metric([run, reason], count)
        latest = self._source.latest(run)
        if latest is not None:
            families.add_round(run, latest)


class _Families:
    """One family per metric, each with a line per run."""

    def __init__(self) -> None:
        counter, gauge = CounterMetricFamily, GaugeMetricFamily
        run = ["run"]
        self.episodes = counter("taskschema_episodes", "Episodes learned from.", labels=run)
        self.steps = counter("taskschema_steps", "Skill pairs executed.", labels=run)
        self.quarantined = counter(
            "taskschema_quarantined_messages", "Messages refused.", labels=["run", "reason"]
        )
        self.physics = gauge(
            "taskschema_round_physics_steps", "Physics steps of the newest round.", labels=run
        )
        self.diverged = gauge(
            "taskschema_round_diverged_episodes", "Episodes of the newest round that diverged.", labels=run
        )
        self.version = gauge("taskschema_policy_version", "Updates behind the newest policy.", labels=run)
        self.success = gauge(
            "taskschema_success_ratio",
            "Share of successful episodes (0 to 1), in the newest round and among the last 100 episodes.",
            labels=["run", "window"],
        )
        self.entropy = gauge(
            "taskschema_schema_entropy_nats", "Entropy of a schema row.", labels=["run", "t"]
        )
        self.probability = gauge(
            "taskschema_schema_best_probability",
            "Probability of a row's most probable pair.",
            labels=["run", "t"],
        )
        self.seconds = gauge(
            "taskschema_round_seconds", "Wall time of the newest round by phase.", labels=["run", "phase"]
        )
        self.live_workers = gauge("taskschema_workers_live", "Workers that are alive.", labels=run)
        self.target = gauge(
            "taskschema_workers_target", "Workers asked for; absent: the capacity.", labels=run
        )
        self.state = gauge(
            "taskschema_run_state", "1 for the state that a run is in.", labels=["run", "state"]
        )

    def add_round(self, run: str, row: RoundMetrics) -> None:
        self.episodes.add_metric([run], row.episodes)
        self.steps.add_metric([run], row.steps)
        self.physics.add_metric([run], row.physics_steps)
        self.diverged.add_metric([run], row.diverged)
        self.version.add_metric([run], row.policy_version)
        self.success.add_metric([run, "round"], row.success_rate)
        self.success.add_metric([run, "last_100"], row.success_last_100)
        for t, value in enumerate(row.schema_entropy, start=1):
            self.entropy.add_metric([run, str(t)], value)
        for t, value in enumerate(row.schema_probability, start=1):
            self.probability.add_metric([run, str(t)], value)
        for phase in ("collect", "update", "checkpoint"):
            self.seconds.add_metric([run, phase], getattr(row, f"seconds_{phase}"))

    def all(self) -> list[Metric]:
        return list(vars(self).values())
