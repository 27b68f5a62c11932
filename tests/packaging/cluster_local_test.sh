#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# docker/cluster_local.sh: what a commit has written is on the standby, survives the primary and a change of roles, and a
# killed primary follows the new one, without what only it had. Exit status 77 where PostgreSQL is not installed.
set -euo pipefail
local=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../docker" && pwd)/cluster_local.sh
home=$(mktemp -d "${TMPDIR:-/tmp}/pliant-cluster-XXXXXX")
chmod 755 "$home"
trap 'bash "$local" remove "$home"' EXIT
fail() { echo "cluster_local_test.sh: $*" >&2; exit 1; }
cluster() { echo "-- $1"; bash "$local" "$1" "$home" "${@:2}"; }

write() { psql -qAtX "$url" -c "INSERT INTO written VALUES ($1)"; }
on_node() { psql -qAtX "postgresql://pliant@127.0.0.1:$(cat "$home/$1/port")/pliant" "${@:2}"; }
has() {  # NODE ROWS : soon, since a commit waits until the standby has flushed, not until it shows
  local rows
  for _ in $(seq 100); do
    rows=$(on_node "$1" -c 'SELECT row FROM written ORDER BY row' 2>/dev/null | tr '\n' ' ') || true
    [ "$rows" != "$2 " ] || return 0
    sleep 0.1
  done
  fail "$1 has the rows $rows, not $2"
}
kill_node() { kill -KILL "$(head -n 1 "$home/$1/data/postmaster.pid")"; }
role() { bash "$local" status "$home" | awk -v node="$1" '$1 == node { print $3 }'; }

cluster up 0
url=$(bash "$local" status "$home" | sed -n "s/^--db '\(.*\)'/\1/p")
psql -qX "$url" -c 'CREATE TABLE written (row int)'
write 1
has db2 1

kill_node db1
cluster promote
[ "$(role db1) $(role db2)" = "standby primary" ] || fail "the roles did not change"
write 2
has db1 "1 2"

cluster promote  # a change of roles without a loss
[ "$(role db1) $(role db2)" = "primary standby" ] || fail "the roles did not change back"
write 3
has db2 "1 2 3"

kill_node db2
if bash "$local" status "$home"; then fail "status does not notice that db2 was killed"; fi
PGOPTIONS='-c synchronous_commit=local' write 4  # which does not wait for the standby
if bash "$local" promote "$home" 2>/dev/null; then fail "a standby that does not run was promoted"; fi
kill_node db1
echo db2 >"$home/primary"  # as if db1 had been out of reach when db2 came back
cluster up
has db2 "1 2 3"
has db1 "1 2 3"
write 5
has db1 "1 2 3 5"

cluster down
if cluster status; then fail "status says that all run, after down"; fi
cluster up
has db2 "1 2 3 5"
has db1 "1 2 3 5"
