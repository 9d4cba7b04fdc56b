#!/bin/sh
# Start one node of a Ray cluster and stay with it; further words go to `ray start`, or are the command.
#   node.sh head            the cluster's head, which offers no CPUs
#   node.sh worker          a node that offers RAY_NODE_CPUS cores (1)
#   node.sh driver COMMAND  a node without CPUs, and a command on it that finds the cluster with `--ray auto`
#
# RAY_AUTH_TOKEN    needed: the secret of the cluster, the same for every node and every client
# RAY_HEAD          HOST:PORT of the head (head:6379)
# RAY_NODE_ADDRESS  this node's address, such as 127.0.0.1; unset: Ray finds one
# RAY_DASHBOARD     HOST:PORT where the head takes `ray job submit`; unset: nowhere
set -eu

if [ -z "${RAY_AUTH_TOKEN:-}" ]; then
  echo "Set RAY_AUTH_TOKEN to a long random text: whoever reaches a Ray without one runs code on it." >&2
  exit 1
fi
export RAY_AUTH_MODE=token RAY_USAGE_STATS_ENABLED=0
# Idle processes started ahead of time lack the actors' environment and would never be used.
export RAY_prestart_worker_first_driver=false
# A node that is told to stop waits so long for its actors, which the pool then lets go [s].
export RAY_GRACEFUL_SHUTDOWN_DRAIN_TIMEOUT_S="${RAY_GRACEFUL_SHUTDOWN_DRAIN_TIMEOUT_S:-10}"
# Where the file system is read-only, log files lie in memory [bytes].
export RAY_ROTATION_MAX_BYTES="${RAY_ROTATION_MAX_BYTES:-4000000}" RAY_ROTATION_BACKUP_COUNT=1

head=${RAY_HEAD:-head:6379}
role=${1:-}
[ $# -eq 0 ] || shift

# About the least object store that Ray takes: no trajectory goes through it [bytes].
common="--object-store-memory=80000000 --include-log-monitor=false"
[ -z "${RAY_NODE_ADDRESS:-}" ] || common="$common --node-ip-address=$RAY_NODE_ADDRESS"

# shellcheck disable=SC2086 # common is several words
case $role in
head)
  if [ -n "${RAY_DASHBOARD:-}" ]; then
    set -- --include-dashboard=true --dashboard-host="${RAY_DASHBOARD%:*}" \
      --dashboard-port="${RAY_DASHBOARD##*:}" "$@"
  else
    set -- --include-dashboard=false "$@"
  fi
  exec ray start --head --block --num-cpus=0 --port="${head##*:}" $common "$@"
  ;;
worker)
  exec ray start --block --address="$head" --num-cpus="${RAY_NODE_CPUS:-1}" $common "$@"
  ;;
driver)
  ray start --address="$head" --num-cpus=0 $common
  exec "$@"
  ;;
*)
  echo "usage: node.sh head | worker | driver COMMAND" >&2
  exit 2
  ;;
esac
