#!/bin/sh
# Go on with the run TASKSCHEMA_RUN below TASKSCHEMA_RUNS (/runs), or start it as training of TASKSCHEMA_TASK: with
# workers on the Ray cluster that this node belongs to, or, where TASKSCHEMA_AGENT is `robot`, for a robot's agent,
# which joins by itself. Further words are options of `taskschema train`.
set -eu
folder=${TASKSCHEMA_RUNS:-/runs}/${TASKSCHEMA_RUN:-lateral-lifting}
if [ -e "$folder/config.json" ]; then
  set -- --resume "$@"
fi
case ${TASKSCHEMA_AGENT:-simulation} in
robot) set -- --agent robot "$@" ;;
*) set -- --ray auto "$@" ;;
esac
exec taskschema train "${TASKSCHEMA_TASK:-lateral-lifting}" --run-dir "$folder" --api none "$@"
