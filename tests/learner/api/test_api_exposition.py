import redis
from api_setup import RUN
from prometheus_client.parser import text_string_to_metric_families

from taskschema.bus.keys import RunKeys


def samples(text):
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def test_metrics_tell_the_newest_round(served, redis_url):
    redis.Redis.from_url(redis_url).hset(RunKeys(RUN).quarantine_counts, mapping={"not finite": 2})
    served.records.set_worker_target(RUN, 7)
    answer = served.http.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain; version=")
    found = samples(answer.text)

    def value(name, **labels):
        return found[name, tuple(sorted({"run": RUN, **labels}.items()))]

    assert value("taskschema_episodes_total") == 600
    assert value("taskschema_steps_total") == 1500
    assert value("taskschema_round_physics_steps") == 0
    assert value("taskschema_round_diverged_episodes") == 1
    assert value("taskschema_policy_version") == 3
    assert value("taskschema_success_ratio", window="last_100") == 0.5
    assert value("taskschema_success_ratio", window="round") == 0.25
    assert round(value("taskschema_schema_entropy_nats", t="3"), 6) == 2.197225  # ln 9: nothing learned
    assert round(value("taskschema_schema_best_probability", t="3"), 6) == 0.111111
    assert value("taskschema_round_seconds", phase="collect") == 1.5
    assert value("taskschema_round_seconds", phase="update") == 0.25
    assert value("taskschema_round_seconds", phase="checkpoint") == 0.125
    assert value("taskschema_quarantined_messages_total", reason="not finite") == 2
    assert value("taskschema_workers_live") == 0
    assert value("taskschema_workers_target") == 7
    assert value("taskschema_run_state", state="running") == 1
    assert value("taskschema_run_state", state="finished") == 0
    assert found["taskschema_source_up", ()] == 1
