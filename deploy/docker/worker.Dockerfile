# A Ray node that rollout actors are placed on; also the head, which places none on itself.
FROM python:3.11.14-slim-bookworm
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore PIP_QUIET=1
COPY deploy/docker/requirements-worker.lock /tmp/
RUN pip install --no-deps -r /tmp/requirements-worker.lock \
 && useradd --uid 10001 --no-create-home taskschema

COPY deploy/ray/node.sh /opt/taskschema/deploy/
COPY shared/taskschema /opt/taskschema/taskschema
COPY services/worker/taskschema_worker /opt/taskschema/taskschema_worker
RUN python -m compileall -q /opt/taskschema
ENV PYTHONPATH=/opt/taskschema PYTHONUNBUFFERED=1 HOME=/tmp
USER 10001:10001
CMD ["/opt/taskschema/deploy/node.sh", "worker"]
