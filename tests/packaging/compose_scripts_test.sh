#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# What the containers of docker/cluster.compose.yaml run, without containers: primary.sh makes the role and the database, and
# standby.sh a standby that the primary knows by the name in synchronous_standby_names, each with its password only.
set -euo pipefail
[ -n "${PLIANT_TEST_DATABASE_HOME:-}" ] || exec bash "$(dirname "${BASH_SOURCE[0]}")/../postgres/on_postgres.sh" bash "$0"
scripts=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../docker/cluster" && pwd)
home=$PLIANT_TEST_DATABASE_HOME
fail() { echo "compose_scripts_test.sh: $*" >&2; exit 1; }
PGPORT=${PLIANT_TEST_DATABASE##*:}
PGPORT=${PGPORT%%/*}
export PGPORT PGUSER=postgres PGHOST=$home PGDATABASE=postgres
PATH=$(dirname "$(tr '\0' '\n' <"/proc/$(head -n 1 "$home/data/postmaster.pid")/cmdline" | head -n 1)"):$PATH
sql() { psql -qAtX -c "$1"; }

# As the image of PostgreSQL begins: a superuser with a password, which other machines need.
psql -qX -c 'DROP DATABASE pliant' -c 'DROP ROLE pliant' -c "ALTER ROLE postgres PASSWORD 'super'" \
  -c "ALTER SYSTEM SET synchronous_standby_names = 'standby'" -c 'ALTER SYSTEM SET synchronous_commit = on'
printf 'local all all trust\nhost all all all scram-sha-256\n' >"$home/data/pg_hba.conf"
sql 'SELECT pg_reload_conf()' >/dev/null
PGDATA=$home/data PLIANT_DB_PASSWORD="it's" bash "$scripts/primary.sh"
sql 'SELECT pg_reload_conf()' >/dev/null

[ "$(PGPASSWORD="it's" psql -qAtX -h 127.0.0.1 -U pliant pliant -c 'SHOW server_encoding')" = UTF8 ] || fail "pliant cannot connect"
if PGPASSWORD=its psql -qAtX -h 127.0.0.1 -U pliant pliant -c 'SELECT 1' 2>/dev/null; then fail "any password is good"; fi

as_user=()
if [ "$(id -u)" -eq 0 ]; then as_user=(--reuid="$(stat -c %u "$home/data")" --regid="$(stat -c %g "$home/data")" --clear-groups); fi
run_standby() {  # PASSWORD
  # As its text: the database's user may not be able to read this folder.
  setpriv "${as_user[@]}" --pdeathsig INT env PGHOST=127.0.0.1 PGPASSWORD="$1" PGDATA="$home/standby" \
    bash -c "$(cat "$scripts/standby.sh")" standby.sh postgres -c cluster_name=standby -c listen_addresses= \
    -c "unix_socket_directories=$home" -p $((PGPORT + 1)) >"$home/standby.log" 2>&1
}
if run_standby wrong; then fail "the primary is copied without its password"; fi
[ ! -e "$home/standby" ] || fail "half a copy looks like a standby"
for start in first second; do
  run_standby super &
  until [ "$(sql "SELECT sync_state FROM pg_stat_replication WHERE application_name = 'standby'")" = sync ]; do
    kill -0 $! 2>/dev/null || { cat "$home/standby.log" >&2; fail "no standby at the $start start"; }
    sleep 0.1
  done
  psql -qX -c "CREATE TABLE $start ()"  # waits for the standby
  kill -INT "$(head -n 1 "$home/standby/postmaster.pid")"
  wait $! || true
done
