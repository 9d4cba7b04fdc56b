#!/bin/sh
# Start Redis (7.0 or newer) with one user per role. The passwords come from REDIS_{LEARNER,WORKER,API,ROBOT}_PASSWORD,
# and only their SHA-256 is written, into memory. Further words are options of redis-server.
#
# The user `default` is off: nobody comes in as it. It has every right all the same, because Redis reads its own log
# again under its name, and would leave out whole transactions (github.com/redis/redis/issues/14541).
set -eu
umask 077
rules=${REDIS_ACL_FILE:-/tmp/users.acl}
sums=
for role in LEARNER WORKER API ROBOT; do
  eval "password=\${REDIS_${role}_PASSWORD:-}"
  if [ -z "$password" ]; then
    echo "Set REDIS_${role}_PASSWORD: every role of Redis has its own." >&2
    exit 1
  fi
  sum=$(printf %s "$password" | sha256sum)
  sums="$sums;s/@REDIS_${role}_SHA256@/${sum%% *}/"
  unset "REDIS_${role}_PASSWORD"
done
unset password
sed "${sums#;}" "${REDIS_ACL_TEMPLATE:-$(dirname "$0")/users.acl.template}" > "$rules"
# Every answered write is on the disk; a blob is a slot's trajectories or a policy.
exec "${REDIS_SERVER:-redis-server}" --dir "${REDIS_DATA:-/data}" --aclfile "$rules" --save '' \
  --appendonly yes --appendfsync always --proto-max-bulk-len 64mb --databases 1 \
  --bind '* -::*' --protected-mode no "$@"
