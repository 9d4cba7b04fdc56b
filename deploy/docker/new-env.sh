#!/bin/sh
# Print .env.example with a new random secret (192 bits) after every empty *_PASSWORD= and *_TOKEN=.
set -eu
while IFS= read -r line; do
  case $line in
  *_PASSWORD= | *_TOKEN=) printf '%s%s\n' "$line" "$(od -An -N24 -tx1 /dev/urandom | tr -d ' \n')" ;;
  *) printf '%s\n' "$line" ;;
  esac
done <"$(dirname "$0")/../../.env.example"
