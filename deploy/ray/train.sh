#!/bin/sh
# Train on the Ray cluster that this node belongs to: go on with the run TASKSCHEMA_RUN below /runs, or start it as
# training of TASKSCHEMA_TASK. Further words are options of `taskschema train`.
set -eu
folder=/runs/${TASKSCHEMA_RUN:-lateral-lifting}
if [ -e "$folder/config.json" ]; then
  set -- --resume "$@"
fi
exec taskschema train "${TASKSCHEMA_TASK:-lateral-lifting}" --run-dir "$folder" --ray auto --api none "$@"
