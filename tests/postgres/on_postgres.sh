#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# on_postgres.sh COMMAND...: runs it with PLIANT_TEST_DATABASE, the URL of an empty database of a PostgreSQL server of its own,
# and PLIANT_TEST_DATABASE_HOME, the server's folder: data/, log, start (what starts the server, also after a test killed it)
# and the Unix socket (psql -h "$PLIANT_TEST_DATABASE_HOME" -p PORT -U postgres is the superuser). Afterwards both are removed.
# Exit status: the command's, or 77 where PostgreSQL is not installed (tests/postgres/install.sh).
# PLIANT_TEST_DATABASE_SLOW=1: the server flushes what it commits, for tests that end it. By default it never does.
set -euo pipefail
[ $# -gt 0 ] || { sed -n '4,/^set/s/^# //p' "$0" >&2; exit 2; }

initdb=$(compgen -G '/usr/lib/postgresql/*/bin/initdb' | sort -V | tail -n 1 || true)
[ -n "$initdb" ] || initdb=$(command -v initdb) || { echo "on_postgres.sh: PostgreSQL is not installed."; exit 77; }
bin=$(dirname "$(readlink -f "$initdb")")

home=$(mktemp -d "${TMPDIR:-/tmp}/pliant-postgres-XXXXXX")
finish() {
  local pid
  # At once, since nobody needs the data any more; and the process of this folder only, whatever has the number of a killed one.
  if pid=$(head -n 1 "$home/data/postmaster.pid" 2>/dev/null); then
    runs() { grep -qsF "$home/data" "/proc/$pid/cmdline"; }
    if runs; then kill -QUIT "$pid"; fi
    while runs; do sleep 0.02; done
  fi
  rm -rf "$home" || rm -rf "$home"  # again, if a process of a killed server wrote meanwhile
}
trap finish EXIT
trap 'exit 129' HUP
trap 'exit 130' INT
trap 'exit 143' TERM

# PostgreSQL refuses to run as root.
as_user=()
if [ "$(id -u)" -eq 0 ]; then
  user=postgres
  id "$user" >/dev/null 2>&1 || user=nobody
  as_user=(--reuid="$user" --regid="$(id -g "$user")" --clear-groups)
  chown "$user" "$home"
fi
cd "$home"
setpriv "${as_user[@]}" "$bin/initdb" -D data -U postgres --auth=trust --encoding=UTF8 --locale=C.UTF-8 --no-sync >log 2>&1 ||
  { cat log >&2; exit 1; }
setpriv "${as_user[@]}" tee -a data/postgresql.conf >/dev/null <<CONF
listen_addresses = '127.0.0.1'
unix_socket_directories = '$home'
max_connections = 300
CONF
if [ "${PLIANT_TEST_DATABASE_SLOW:-}" != 1 ]; then
  setpriv "${as_user[@]}" tee -a data/postgresql.conf >/dev/null <<<$'fsync = off\nsynchronous_commit = off\nfull_page_writes = off'
fi

# The server ends with the shell or test that started it, even if that is killed.
write_start() {  # PORT
  printf '#!/bin/sh\nexec setpriv %s --pdeathsig INT %q -D %q -p %s >>%q 2>&1\n' "${as_user[*]}" "$bin/postgres" "$home/data" "$1" "$home/log" >start
  chmod +x start
}

# Another program may take a port between its choice and its use, so choose until the server has one.
port=
while [ -z "$port" ]; do
  port=$(shuf -n 1 -i 20000-29999)
  write_start "$port"
  ./start &
  starting=$!
  disown  # the shell says nothing when a test kills it
  until "$bin/pg_isready" -q -h "$home" -p "$port" -U postgres -d postgres; do
    if ! kill -0 "$starting" 2>/dev/null; then
      grep -q 'Address already in use' log || { cat log >&2; exit 1; }
      : >log
      port=
      break
    fi
    sleep 0.02
  done
done
"$bin/psql" -q -h "$home" -p "$port" -U postgres -d postgres -c 'CREATE ROLE pliant LOGIN' -c 'CREATE DATABASE pliant OWNER pliant'
cd "$OLDPWD"

export PLIANT_TEST_DATABASE=postgresql://pliant@127.0.0.1:$port/pliant PLIANT_TEST_DATABASE_HOME=$home
"$@"
