# The learner, and the whole command with the simulator (target `embedded`). What both install comes before the source.
FROM python:3.11.14-slim-bookworm AS source
COPY deploy/ray/node.sh deploy/ray/train.sh /opt/taskschema/deploy/
COPY shared/taskschema /opt/taskschema/taskschema
COPY services/worker/taskschema_worker /opt/taskschema/taskschema_worker
COPY services/learner/taskschema_learner /opt/taskschema/taskschema_learner
RUN python -m compileall -q /opt/taskschema

FROM python:3.11.14-slim-bookworm AS learner-dependencies
# Where CPU wheels of torch are; empty: the ordinary index, whose wheels bring gigabytes for GPUs along.
ARG TORCH_INDEX_URL=""
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore PIP_QUIET=1
COPY deploy/docker/requirements-learner.lock /tmp/
RUN pip install ${TORCH_INDEX_URL:+--extra-index-url "$TORCH_INDEX_URL"} \
    --constraint /tmp/requirements-learner.lock torch==2.13.0 \
 && pip install --no-deps -r /tmp/requirements-learner.lock \
 && useradd --uid 10001 --no-create-home taskschema \
 && install -d -o taskschema -g taskschema /runs
COPY deploy/docker/taskschema /usr/local/bin/
ENV PYTHONPATH=/opt/taskschema PYTHONUNBUFFERED=1 HOME=/tmp
WORKDIR /

FROM learner-dependencies AS learner
COPY --from=source /opt/taskschema /opt/taskschema
USER 10001:10001
CMD ["/opt/taskschema/deploy/node.sh", "driver", "/opt/taskschema/deploy/train.sh"]

FROM learner-dependencies AS embedded
COPY deploy/docker/requirements-worker.lock /tmp/
RUN pip install --no-deps -r /tmp/requirements-worker.lock
COPY --from=source /opt/taskschema /opt/taskschema
USER 10001:10001
CMD ["taskschema", "--help"]
