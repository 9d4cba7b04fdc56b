"""Facts about runs as Prometheus metrics, read from the source whenever they are scraped."""

from collections.abc import Iterator
from itertools import accumulate

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric
from prometheus_client.process_collector import ProcessCollector
from prometheus_client.registry import Collector

from taskschema.bus.counters import BOUNDS, Histogram, RunCounters
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
        families.add_counters(run, self._source.counters(run))
        latest = self._source.latest(run)
        if latest is not None:
            families.add_round(run, latest)


class _Families:
    """One family per metric, each with a line per run."""

    def __init__(self) -> None:
        run = ["run"]
        self.episodes = _counter("episodes", "Episodes learned from.", run)
        self.steps = _counter("skill_steps", "Skill pairs executed.", run)
        self.physics = _counter("physics_steps", "Physics steps computed.", run)
        self.diverged = _counter("diverged_episodes", "Episodes whose simulation broke down.", run)
        self.refused = _counter("refused_steps", "Steps that a safety gate refused.", run)
        self.quarantined = _counter("quarantined_messages", "Messages refused.", ["run", "reason"])
        self.joined = _counter("workers_joined", "Workers that joined; a restarted one joins again.", run)
        self.lost = _counter("workers_lost", "Workers that fell silent without leaving.", run)
        self.taken_over = _counter("leases_taken_over", "Leases taken from a worker that died or left.", run)
        self.learners = _counter("learner_starts", "Learners that took the run on.", run)
        self.version = _gauge("policy_version", "Updates behind the newest policy.", run)
        self.success = _gauge(
            "success_ratio",
            "Share of successful episodes (0 to 1), in the newest round and among the last 100 episodes.",
            ["run", "window"],
        )
        self.entropy = _gauge("schema_entropy_nats", "Entropy of a schema row.", ["run", "t"])
        self.probability = _gauge(
            "schema_best_probability", "Probability of a row's most probable pair.", ["run", "t"]
        )
        self.rounds = _histogram("round_duration_seconds", "Wall time of a round by phase.", ["run", "phase"])
        self.publish = _histogram(
            "publish_duration_seconds", "Time to publish a round's policy and offer its slots.", run
        )
        self.leases = _histogram("lease_duration_seconds", "Time from leasing a slot to delivering it.", run)
        self.live_workers = _gauge("workers_live", "Workers that are alive.", run)
        self.target = _gauge("workers_target", "Workers asked for; absent: the capacity.", run)
        self.state = _gauge("run_state", "1 for the state that a run is in.", ["run", "state"])

    def add_counters(self, run: str, counters: RunCounters) -> None:
        self.physics.add_metric([run], counters.physics_steps)
        self.diverged.add_metric([run], counters.diverged)
        self.refused.add_metric([run], counters.refused)
        self.joined.add_metric([run], counters.workers_joined)
        self.lost.add_metric([run], counters.workers_lost)
        self.taken_over.add_metric([run], counters.leases_taken_over)
        self.learners.add_metric([run], counters.learner_starts)
        for phase, histogram in counters.phases.items():
            if phase == "publish":
                _add(self.publish, [run], histogram)
            else:
                _add(self.rounds, [run, phase], histogram)
        _add(self.leases, [run], counters.leases)

    def add_round(self, run: str, row: RoundMetrics) -> None:
        self.episodes.add_metric([run], row.episodes)
        self.steps.add_metric([run], row.steps)
        self.version.add_metric([run], row.policy_version)
        self.success.add_metric([run, "round"], row.success_rate)
        self.success.add_metric([run, "last_100"], row.success_last_100)
        for t, value in enumerate(row.schema_entropy, start=1):
            self.entropy.add_metric([run, str(t)], value)
        for t, value in enumerate(row.schema_probability, start=1):
            self.probability.add_metric([run, str(t)], value)

    def all(self) -> list[Metric]:
        return list(vars(self).values())


def _counter(name: str, help_text: str, labels: list[str]) -> CounterMetricFamily:
    return CounterMetricFamily(f"taskschema_{name}", help_text, labels=labels)


def _gauge(name: str, help_text: str, labels: list[str]) -> GaugeMetricFamily:
    return GaugeMetricFamily(f"taskschema_{name}", help_text, labels=labels)


def _histogram(name: str, help_text: str, labels: list[str]) -> HistogramMetricFamily:
    return HistogramMetricFamily(f"taskschema_{name}", help_text, labels=labels)


def _add(family: HistogramMetricFamily, labels: list[str], histogram: Histogram) -> None:
    ends = [*map(str, BOUNDS), "+Inf"]
    buckets = list(zip(ends, map(float, accumulate(histogram.counts)), strict=True))
    family.add_metric(labels, buckets, histogram.total)
