"""The endpoints, one file per subject."""

from taskschema_learner.api.routes import act, events, health, metrics, policy, runs, schema, workers

ROUTERS = (
    health.router,
    schema.router,
    policy.router,
    act.router,
    runs.router,
    workers.router,
    events.router,
    metrics.router,
)

__all__ = ["ROUTERS"]
