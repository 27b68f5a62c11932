#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# PostgreSQL with a standby, and pliant-server processes, on this machine, for trying and testing: plain processes on free
# ports of loopback, all in one folder. No service is installed or enabled. Every user of this machine can connect to them.
#
#   cluster_local.sh up DIR [SERVERS]   starts what does not run (two databases; 2 servers, or as many as before), waits until
#                                       all answer, and prints their addresses and the URL for --db
#   cluster_local.sh up DIR --parts P [--copies C]
#                                       the same with the index in P parts, each on C servers (2). With another P than before:
#                                       starts the new servers, switches DIR/peers.toml to them, ends the old ones
#   cluster_local.sh status DIR         what runs; exit status 1 unless all answer
#   cluster_local.sh promote DIR        makes the standby the primary; the old primary, running or killed, becomes its standby
#   cluster_local.sh down DIR           ends all in order; the data stay, and `up` continues with them
#   cluster_local.sh remove DIR         ends all at once and removes the data
#
# A commit waits until the standby has flushed it (synchronous_commit = on). remote_apply would also wait until queries on the
# standby see it, but nobody queries the standby: the URL leads every client to the primary.
# Needs Debian's postgresql (exit status 77 without it); for servers also curl and Pliant's programs, from PLIANT_BIN, PATH or build/.
set -euo pipefail
unset "${!PG@}"  # libpq's variables are about other databases

usage() { sed -n '/^#   /s/^# //p' "$0" >&2; exit 2; }
fail() { echo "cluster_local.sh: $*" >&2; exit 1; }

[ $# -ge 2 ] || usage
action=$1
mkdir -p "$2" 2>/dev/null || fail "cannot make the folder $2"
home=$(cd "$2" && pwd -P)
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
case $home in *[!A-Za-z0-9/._-]*) fail "the folder's name can have letters, digits and . _ - only: $home" ;; esac

initdb=$(compgen -G '/usr/lib/postgresql/*/bin/initdb' | sort -V | tail -n 1 || true)
[ -n "$initdb" ] || initdb=$(command -v initdb) || { echo "cluster_local.sh: PostgreSQL is missing: apt-get install postgresql" >&2; exit 77; }
PATH=$(dirname "$(readlink -f "$initdb")"):$PATH
as_user=()
if [ "$(id -u)" -eq 0 ]; then  # PostgreSQL refuses to run as root
  as_user=(setpriv --reuid=postgres --regid="$(id -g postgres)" --clear-groups)
  "${as_user[@]}" test -x "$home" || fail "the user postgres cannot enter $home"
fi
as_postgres() { (cd "$home" && "${as_user[@]}" "$@" 9>&-); }  # without the lock, which is this script's

# -- the databases, db1 and db2; $home/primary names the one that is, or is about to be, the primary

port() { cat "$home/$1/port"; }
primary() { cat "$home/primary" 2>/dev/null || echo db1; }
standby() { if [ "$(primary)" = db1 ]; then echo db2; else echo db1; fi; }
source_of() { echo "host=127.0.0.1 port=$(port "$1") user=postgres dbname=postgres"; }
sql() { psql -qAtX -d "$(source_of "$1") connect_timeout=5" "${@:2}"; }  # NODE ARGUMENTS...
db_runs() {
  local pid
  pid=$(head -n 1 "$home/$1/data/postmaster.pid" 2>/dev/null) || return 1
  for _ in $(seq 100); do  # until a killed process is gone: PostgreSQL takes what is left of it for a server
    grep -qs '^State:.Z' "/proc/$pid/status" || break
    sleep 0.1
  done
  grep -qsF "$home/$1/data" "/proc/$pid/cmdline"  # another process may have that number since
}
url() { echo "postgresql://pliant@127.0.0.1:$(port db1),127.0.0.1:$(port db2)/pliant?target_session_attrs=read-write"; }

prepare() {  # NAME : its folder and its port, chosen once, because the URL names it
  mkdir -p "$home/$1"
  [ -s "$home/$1/port" ] && return
  local port
  for port in $(shuf -n 100 -i 20000-29999); do
    (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null || break
  done
  echo "$port" >"$home/$1/port"
}

make_data() {  # NODE COMMAND... : has the command make the data in a folder that gets its name when they are complete
  if [ "$(id -u)" -eq 0 ]; then chown postgres "$home/$1"; fi
  as_postgres rm -rf "$home/$1/data.new"
  as_postgres "${@:2}" -D "$home/$1/data.new" >"$home/made.log" 2>&1 || { cat "$home/made.log" >&2; fail "no data for $1"; }
}

start_db() {  # NODE
  db_runs "$1" && return
  as_postgres pg_ctl start -s -w -t 120 -D "$home/$1/data" -l "$home/$1/log" \
    -o "-p $(port "$1") -c cluster_name=$1 -c primary_conninfo='$(source_of "$([ "$1" = db1 ] && echo db2 || echo db1)")'" ||
    { tail -n 5 "$home/$1/log" >&2; fail "$1 does not start; see $home/$1/log"; }
}

start_primary() {
  local node
  node=$(primary)
  if [ ! -e "$home/$node/data" ]; then
    [ ! -e "$home/primary" ] || fail "the data of $node, the primary, are gone"
    make_data "$node" initdb -U postgres --auth=trust --encoding=UTF8 --locale=C.UTF-8 --data-checksums  # pg_rewind needs them
    as_postgres tee -a "$home/$node/data.new/postgresql.conf" >/dev/null <<CONF
listen_addresses = '127.0.0.1'
unix_socket_directories = ''
max_connections = 200
synchronous_standby_names = 'db1, db2'
wal_keep_size = '1GB'                   # what a standby can miss
wal_retrieve_retry_interval = '200ms'
CONF
    as_postgres mv "$home/$node/data.new" "$home/$node/data"
    echo "$node" >"$home/primary"
  fi
  start_db "$node"
  if [ "$(sql "$node" -c 'SELECT pg_is_in_recovery()')" = t ]; then
    as_postgres pg_ctl promote -s -w -t 60 -D "$home/$node/data"
    sql "$node" -c CHECKPOINT  # pg_rewind looks for the new timeline in it
  fi
  if [ -z "$(sql "$node" -c "SELECT 1 FROM pg_database WHERE datname = 'pliant'")" ]; then  # no standby has it yet
    PGOPTIONS='-c synchronous_commit=local' sql "$node" -c 'SET client_min_messages = warning' -c 'DROP ROLE IF EXISTS pliant' \
      -c 'CREATE ROLE pliant LOGIN IN ROLE pg_monitor' -c 'CREATE DATABASE pliant OWNER pliant'
  fi
}

replicates() { [ -n "$(sql "$(primary)" -c "SELECT 1 FROM pg_stat_replication WHERE application_name = '$(standby)' AND sync_state = 'sync'" 2>/dev/null)" ]; }

start_standby() {
  local node
  node=$(standby)
  if [ ! -e "$home/$node/data" ]; then
    make_data "$node" pg_basebackup -d "$(source_of "$(primary)")" --checkpoint=fast
    as_postgres touch "$home/$node/data.new/standby.signal"
    as_postgres mv "$home/$node/data.new" "$home/$node/data"
  elif [ ! -e "$home/$node/data/standby.signal" ]; then  # it was the primary: what only it has goes
    db_runs "$node" || true  # pg_rewind, too, takes what is left of a killed process for a server
    as_postgres pg_rewind -D "$home/$node/data" --source-server="$(source_of "$(primary)")" >"$home/made.log" 2>&1 ||
      { cat "$home/made.log" >&2; fail "$node cannot follow; rm -r $home/$node/data, and up copies the primary again"; }
    as_postgres touch "$home/$node/data/standby.signal"
  fi
  start_db "$node"
  wait_for db_runs "$node" replicates || fail "$node does not follow; see $home/$node/log"
}

wait_for() {  # RUNS NAME COMMAND... : at most two minutes, less when the process ends
  local runs=$1 name=$2
  for _ in $(seq 600); do
    "${@:3}" && return 0
    "$runs" "$name" || return 1
    sleep 0.2
  done
  return 1
}

# -- the servers, server1, server2, ...

servers() { find "$home" -maxdepth 1 -name 'server*' -printf '%f\n' | sort -V; }
part() { cat "$home/$1/part" 2>/dev/null || true; }  # of a server: 1/2; nothing: it holds the whole index
server_pid() { local pid; pid=$(cat "$home/$1/pid" 2>/dev/null) && grep -qsF "127.0.0.1:$(port "$1")" "/proc/$pid/cmdline" && echo "$pid"; }
server_runs() { server_pid "$1" >/dev/null; }
ready() { curl -fs -m 5 --noproxy '*' -o /dev/null "http://127.0.0.1:$(port "$1")/readyz"; }

start_servers() {
  local name program options
  PATH=${PLIANT_BIN:+$PLIANT_BIN:}$PATH:$(compgen -G "$here/../build/*/bin" | tr '\n' ':' || true)
  for name in $(servers); do
    server_runs "$name" && continue
    for program in pliant pliant-server curl; do command -v "$program" >/dev/null || fail "$program is missing"; done
    pliant db init --db "$(url)" >/dev/null
    options=()
    if [ -n "$(part "$name")" ]; then options=(--part "$(part "$name")" --peers "$home/peers.toml" --index-dir "$home/$name"); fi
    setsid pliant-server --db "$(url)" --listen "127.0.0.1:$(port "$name")" "${options[@]}" >>"$home/$name/log" 2>&1 </dev/null 9>&- &
    echo $! >"$home/$name/pid"
  done
  for name in $(servers); do
    wait_for server_runs "$name" ready "$name" || { tail -n 5 "$home/$name/log" >&2; fail "$name is not ready; see $home/$name/log"; }
  done
}

stop_servers() {  # SIGNAL [NAME...] : these or all; and SIGKILL for what ignores that for 40 seconds
  local name end=$((SECONDS + 40)) names=("${@:2}")
  if [ $# -eq 1 ]; then mapfile -t names < <(servers); fi
  for name in "${names[@]}"; do
    if server_runs "$name"; then kill "-$1" "$(server_pid "$name")" || true; fi
  done
  for name in "${names[@]}"; do
    while server_runs "$name"; do
      [ "$SECONDS" -lt "$end" ] || kill -KILL "$(server_pid "$name")" || true
      sleep 0.1
    done
  done
}

# -- the parts of the index

servers_of() { local name; for name in $(servers); do if [[ $(part "$name") =~ ^$1$ ]]; then echo "$name"; fi; done; }  # PATTERN: 1/2, or .*/2

write_peers() {  # PARTS : the servers of this layout, under the name that all servers read; a key there stays
  local part
  { sed '/^\[parts\]/,$d' "$home/peers.toml" 2>/dev/null || true
    echo '[parts]'
    for part in $(seq "$1"); do
      echo "$part = [$(for name in $(servers_of "$part/$1"); do echo "\"http://127.0.0.1:$(port "$name")\""; done | paste -sd,)]"
    done
  } >"$home/peers.toml.new"
  mv "$home/peers.toml.new" "$home/peers.toml"
}

prepare_parts() {  # PARTS COPIES : the folders of servers that are missing; the new ones hold parts of the new layout
  local part last name
  for part in $(seq "$1"); do
    while [ "$(servers_of "$part/$1" | wc -l)" -lt "$2" ]; do
      last=$(servers | tail -n 1)
      name=server$((${last#server} + 1))
      prepare "$name"
      echo "$part/$1" >"$home/$name/part"
    done
  done
}

retire_others() {  # PARTS : ends the servers that are not of this layout
  local name
  for name in $(servers | grep -vxF "$(servers_of ".*/$1")"); do
    stop_servers TERM "$name"
    rm -rf "${home:?}/$name"
  done
}

stop_db() {  # NODE MODE
  db_runs "$1" || return 0
  as_postgres pg_ctl stop -s -w -t 120 -D "$home/$1/data" -m "$2" || ! db_runs "$1"  # it may have been ending just then
}

status() {
  local all=0 node state
  [ -s "$home/primary" ] || fail "there is no cluster in $home; make one with: cluster_local.sh up $home"
  for node in db1 db2; do
    case $(sql "$node" -c 'SELECT pg_is_in_recovery()' 2>/dev/null) in
      f) state=primary ;;
      t) state=standby; if [ "$node" = "$(standby)" ] && ! replicates; then state="standby that does not follow"; all=1; fi ;;
      *) state="does not answer"; all=1 ;;
    esac
    echo "$node  127.0.0.1:$(port "$node")  $state"
  done
  for node in $(servers); do
    state=ready; ready "$node" || { state="is not ready"; all=1; }
    echo "$node  http://127.0.0.1:$(port "$node")  $state  $(part "$node")"
  done
  echo "--db '$(url)'"
  return "$all"
}

up() {
  local name parts=0 copies=2 count
  if [ "${1:-}" = --parts ]; then
    [[ "$*" =~ ^--parts\ [1-9][0-9]*(\ --copies\ [1-9][0-9]*)?$ ]] || usage
    parts=$2 copies=${4:-2} count=0
  else
    count=${1:-$([ -e "$home/primary" ] && echo 0 || echo 2)}
    [[ $count =~ ^[0-9]+$ ]] || usage
  fi
  for name in db1 db2 $(seq -f 'server%g' "$count"); do prepare "$name"; done
  start_primary
  start_standby
  if [ "$parts" -gt 0 ]; then
    prepare_parts "$parts" "$copies"
    [ -e "$home/peers.toml" ] || write_peers "$parts"
    start_servers
    write_peers "$parts"
    retire_others "$parts"
  fi
  if [ -n "$(servers)" ]; then start_servers; fi
  status
}

exec 9>"$home/lock"
flock -w 300 9 || fail "another cluster_local.sh works in $home"
case $action in
  up) up "${@:3}" ;;
  status) status ;;
  promote)
    [ "$(sql "$(standby)" -c 'SELECT pg_is_in_recovery()' 2>/dev/null)" = t ] || fail "the standby does not run. Call up first."
    stop_db "$(primary)" fast  # never two primaries
    standby >"$home/primary.new"
    mv "$home/primary.new" "$home/primary"
    up
    ;;
  down)
    stop_servers TERM
    stop_db "$(primary)" fast  # which waits until the standby has everything
    stop_db "$(standby)" fast
    ;;
  remove)
    stop_servers KILL
    for name in db1 db2; do stop_db "$name" immediate; done
    for name in db1 db2 $(servers); do rm -rf "${home:?}/$name"; done
    rm -f "$home/primary" "$home/peers.toml" "$home/made.log" "$home/lock"
    rmdir "$home" 2>/dev/null || true  # unless something else is there
    ;;
  *) usage ;;
esac
