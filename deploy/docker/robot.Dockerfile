# The agent for two real arms, with its twin: no Ray, no torch.
FROM python:3.11.14-slim-bookworm
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore PIP_QUIET=1
COPY deploy/docker/requirements-robot.lock /tmp/
RUN pip install --no-deps -r /tmp/requirements-robot.lock \
 && useradd --uid 10001 --no-create-home taskschema \
 && install -d -o taskschema -g taskschema /episodes \
 && install -d -o taskschema -g taskschema -m 700 /twin

COPY deploy/docker/taskschema-robot /usr/local/bin/
COPY shared/taskschema /opt/taskschema/taskschema
COPY services/robot_agent/taskschema_robot /opt/taskschema/taskschema_robot
RUN python -m compileall -q /opt/taskschema
ENV PYTHONPATH=/opt/taskschema PYTHONUNBUFFERED=1 HOME=/tmp
USER 10001:10001
CMD ["taskschema-robot", "--help"]
