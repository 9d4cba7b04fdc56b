# The HTTP API: no simulator, no torch, no Ray.
FROM python:3.11.14-slim-bookworm
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore PIP_QUIET=1
COPY deploy/docker/requirements-api.lock /tmp/
RUN pip install --no-deps -r /tmp/requirements-api.lock \
 && useradd --uid 10001 --no-create-home taskschema

COPY shared/taskschema /opt/taskschema/taskschema
COPY services/learner/taskschema_learner /opt/taskschema/taskschema_learner
RUN python -m compileall -q /opt/taskschema
ENV PYTHONPATH=/opt/taskschema PYTHONUNBUFFERED=1 HOME=/tmp
USER 10001:10001
CMD ["python", "-m", "taskschema_learner.api", "--host", "0.0.0.0", "--port", "8420"]
