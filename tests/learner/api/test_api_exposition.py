import redis
from api_setup import RUN
from prometheus_client.parser import text_string_to_metric_families

from taskschema.bus.counters import LEASE, observe
from taskschema.bus.keys import RunKeys


def samples(text):
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def test_metrics_tell_the_newest_round(served, redis_url):
    client = redis.Redis.from_url(redis_url)
    client.hset(RunKeys(RUN).quarantine_counts, mapping={"not finite": 2})
    observe(client, RunKeys(RUN).leases, LEASE, 0.02, count=4)
    observe(client, RunKeys(RUN).leases, LEASE, 400.0)
    client.hincrby(RunKeys(RUN).leases, "joined", 5)
    client.set(RunKeys(RUN).fence, 2)
    served.records.set_worker_target(RUN, 7)
    answer = served.http.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain; version=")
    found = samples(answer.text)

    def value(name, **labels):
        return found[name, tuple(sorted({"run": RUN, **labels}.items()))]

    assert value("taskschema_episodes_total") == 600
    assert value("taskschema_skill_steps_total") == 1500
    assert value("taskschema_physics_steps_total") == 0
    assert value("taskschema_diverged_episodes_total") == 3, "one in each of three rounds"
    assert value("taskschema_refused_steps_total") == 12, "four in each of three rounds"
    assert value("taskschema_policy_version") == 3
    assert value("taskschema_success_ratio", window="last_100") == 0.5
    assert value("taskschema_success_ratio", window="round") == 0.25
    assert round(value("taskschema_schema_entropy_nats", t="3"), 6) == 2.197225  # ln 9: nothing learned
    assert round(value("taskschema_schema_best_probability", t="3"), 6) == 0.111111
    for phase, seconds, below, above in (
        ("collect", 1.5, "1.0", "2.5"),
        ("update", 0.25, "0.1", "0.25"),
        ("checkpoint", 0.125, "0.1", "0.25"),
    ):
        name = "taskschema_round_duration_seconds"
        assert value(f"{name}_count", phase=phase) == 3
        assert value(f"{name}_sum", phase=phase) == 3 * seconds
        assert (
            value(f"{name}_bucket", phase=phase, le=below),
            value(f"{name}_bucket", phase=phase, le=above),
        ) == (0, 3)
        assert value(f"{name}_bucket", phase=phase, le="+Inf") == 3
    assert value("taskschema_publish_duration_seconds_count") == 3
    assert value("taskschema_quarantined_messages_total", reason="not finite") == 2
    assert value("taskschema_lease_duration_seconds_bucket", le="0.01") == 0
    assert value("taskschema_lease_duration_seconds_bucket", le="0.025") == 4
    assert value("taskschema_lease_duration_seconds_bucket", le="300.0") == 4
    assert value("taskschema_lease_duration_seconds_bucket", le="+Inf") == 5
    assert round(value("taskschema_lease_duration_seconds_sum"), 6) == 400.08
    assert value("taskschema_workers_joined_total") == 5
    assert value("taskschema_workers_lost_total") == 0
    assert value("taskschema_leases_taken_over_total") == 0
    assert value("taskschema_learner_starts_total") == 2
    assert value("taskschema_workers_live") == 0
    assert value("taskschema_workers_target") == 7
    assert value("taskschema_run_state", state="running") == 1
    assert value("taskschema_run_state", state="finished") == 0
    assert found["taskschema_source_up", ()] == 1
