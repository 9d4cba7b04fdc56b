#!/bin/sh
# Start Prometheus with the token that it reads metrics with, from TASKSCHEMA_API_READ_TOKEN; further words are its options.
set -eu
umask 077
if [ -z "${TASKSCHEMA_API_READ_TOKEN:-}" ]; then
  echo "Set TASKSCHEMA_API_READ_TOKEN: the API tells metrics to nobody without it." >&2
  exit 1
fi
printf %s "$TASKSCHEMA_API_READ_TOKEN" > /tmp/api-read-token
unset TASKSCHEMA_API_READ_TOKEN
exec prometheus --config.file=/etc/prometheus/prometheus.yml --storage.tsdb.path=/prometheus "$@"
