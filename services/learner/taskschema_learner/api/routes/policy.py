"""The policy: its bytes, and what they mean."""

from fastapi import APIRouter, Request, Response
from starlette.concurrency import run_in_threadpool

from taskschema.arrays import AnyArray
from taskschema.bus.records import PublishedPolicy
from taskschema.policies import PolicySnapshot
from taskschema.tasks.registry import task_of
from taskschema_learner.api.models import ArgumentAnswer, FieldAnswer, PolicyMeta, TensorAnswer
from taskschema_learner.api.routes.answers import NOT_MODIFIED, UNKNOWN, Responses, tagged
from taskschema_learner.api.source import RunSource
from taskschema_learner.api.state import RunName, State

router = APIRouter(tags=["policy"])

_BYTES: Responses = {
    200: {
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
        "description": "safetensors: the network's arrays and `schema.logits` [T, |X|].",
    }
}


@router.get("/policy", response_class=Response, responses={**_BYTES, **UNKNOWN, **NOT_MODIFIED})
async def policy(request: Request, state: State, run: RunName) -> Response:
    """Return the newest weights and logits as safetensors; the ETag is the policy's SHA-256."""
    newest = await state.policies.get(run)
    return tagged(
        request,
        newest.data,
        f'"{newest.sha256}"',
        "application/octet-stream",
        {"Policy-Version": str(newest.version)},
    )


@router.get("/policy/meta", responses=UNKNOWN)
async def policy_meta(state: State, run: RunName) -> PolicyMeta:
    """Return the policy's version, hash and arrays, the observation's fields and the arguments."""
    newest = await state.policies.get(run)
    return await run_in_threadpool(describe, state.source, run, newest)


def describe(source: RunSource, run: str, newest: PublishedPolicy) -> PolicyMeta:
    """Describe a policy and its task.

    Raises:
        TaskFileError: if the run's own task file does not load here.
    """
    config = source.config(run)
    task = task_of(config)
    space = task.seen_pairs(config.observation)
    arguments = zip(space.argument_names, space.arguments, strict=True)
    snapshot = PolicySnapshot.from_bytes(newest.data)
    tensors: dict[str, AnyArray] = {**snapshot.weights, "schema.logits": snapshot.logits}
    return PolicyMeta(
        run=run,
        task=task.name,
        policy=config.policy,
        version=newest.version,
        sha256=newest.sha256,
        size=len(newest.data),
        horizon=task.horizon,
        pairs=list(task.pairs.pairs),
        tensors=[
            TensorAnswer(name=name, dtype=array.dtype.name, shape=list(array.shape))
            for name, array in sorted(tensors.items())
        ],
        observation=[
            FieldAnswer(name=field.name, size=field.size, unit=field.unit, meaning=field.meaning)
            for field in (task.observation.fields if config.observation == "state" else ())
        ],
        arguments=[
            ArgumentAnswer(
                name=name,
                unit=argument.unit,
                low=argument.low,
                high=argument.high,
                periodic=argument.periodic,
                meaning=argument.meaning,
            )
            for name, argument in arguments
        ],
    )
