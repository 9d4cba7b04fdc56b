"""Acting on an observation."""

from fastapi import APIRouter
from starlette.concurrency import run_in_threadpool

from taskschema.bus.records import PublishedPolicy
from taskschema_learner.api.models import ActAnswer, ActRequest
from taskschema_learner.api.routes.answers import CONFLICT, UNKNOWN
from taskschema_learner.api.state import ApiState, RunName, State

router = APIRouter(tags=["policy"])


@router.post("/act", responses={**UNKNOWN, **CONFLICT})
async def act(body: ActRequest, state: State, run: RunName) -> ActAnswer:
    """Choose both arms' skills and arguments for an observation, with the newest policy.

    The pair comes first, then the arguments of its skills, clipped (angles: wrapped) into their search
    spaces, in SI units.
    """
    newest = await state.policies.get(run)
    return await run_in_threadpool(_act, state, run, newest, body)


def _act(state: ApiState, run: str, newest: PublishedPolicy, body: ActRequest) -> ActAnswer:
    return state.actors.get(run, newest).act(run, body)
