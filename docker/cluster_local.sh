#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# A small ClickHouse cluster on this machine, for trying and testing: ZooKeeper and SHARDS x REPLICAS
# servers as plain processes on free ports, all in one folder. No service is installed or enabled.
#
#   cluster_local.sh up DIR [SHARDS REPLICAS]   starts what does not run (2 x 2), waits until all
#                                               answer, and prints the URL for --db
#   cluster_local.sh status DIR                 who runs; exit status 1 unless all answer
#   cluster_local.sh down DIR                   stops all; the data stay, and `up` goes on with them
#   cluster_local.sh remove DIR                 ends all at once and removes the data
#
# Needs Debian's packages clickhouse-server, libzookeeper-java, default-jre-headless and curl; without
# them exit status 77. CLICKHOUSE_DIR may name a folder where the first is unpacked and not installed.
set -euo pipefail
PATH=$PATH:/usr/sbin
libraries=${LD_LIBRARY_PATH:-}
if [ -n "${CLICKHOUSE_DIR:-}" ] && [ -x "$CLICKHOUSE_DIR/usr/sbin/clickhouse-server" ]; then
  PATH=$CLICKHOUSE_DIR/usr/sbin:$PATH
  libraries=$(dirname "$(ls -d "$CLICKHOUSE_DIR"/usr/lib/*/libclickhouse.so.* | head -n 1)")${libraries:+:$libraries}
fi

usage() { sed -n '/^#   /s/^# //p' "$0" >&2; exit 2; }
fail() { echo "cluster_local.sh: $*" >&2; exit 1; }

[ $# -ge 2 ] || usage
action=$1
mkdir -p "$2" 2>/dev/null || fail "cannot make the folder $2"
home=$(cd "$2" && pwd -P)
case $home in *[!A-Za-z0-9/._-]*) fail "the folder's name may have letters, digits and . _ - only: $home" ;; esac

# The processes of this folder, and no others: a number may have been given to a new process since.
pid_of() {
  local pid
  pid=$(cat "$home/$1/pid" 2>/dev/null) || return 1
  [ -n "$pid" ] && tr '\0' ' ' 2>/dev/null <"/proc/$pid/cmdline" | grep -qF "$home/$1/" && echo "$pid"
}

stop() {  # NODE... : ends them together, in at most 20 seconds
  local node pid left
  for node in "$@"; do pid=$(pid_of "$node") && kill "$pid" 2>/dev/null || true; done
  for _ in $(seq 100); do
    left=
    for node in "$@"; do if pid_of "$node" >/dev/null; then left=1; fi; done
    [ -n "$left" ] || break
    sleep 0.2
  done
  kill_now "$@"
}

kill_now() {  # NODE...
  local node pid
  for node in "$@"; do pid=$(pid_of "$node") && kill -KILL "$pid" 2>/dev/null || true; rm -f "$home/$node/pid"; done
}

nodes() { cat "$home/nodes" 2>/dev/null || true; }  # lines: name, shard, HTTP, TCP and interserver port

free_ports() {  # N : that many ports that nobody listens on
  local port count=0
  for port in $(shuf -i 20000-29999); do
    if ! (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null; then
      echo "$port"
      count=$((count + 1))
      [ "$count" -lt "$1" ] || return 0
    fi
  done
}

write_keeper() {
  mkdir -p "$home/zookeeper/data"
  cat >"$home/zookeeper/zoo.cfg" <<EOF
tickTime=2000
dataDir=$home/zookeeper/data
clientPort=$1
clientPortAddress=127.0.0.1
admin.enableServer=false
maxClientCnxns=0
autopurge.purgeInterval=1
4lw.commands.whitelist=srvr
EOF
}

write_shards() {
  local shard
  for shard in $(cut -d' ' -f2 "$home/nodes" | sort -un); do
    echo "<shard><internal_replication>true</internal_replication>"
    awk -v shard="$shard" '$2 == shard {
      print "<replica><host>127.0.0.1</host><port>" $4 "</port></replica>" }' "$home/nodes"
    echo "</shard>"
  done
}

write_node() {  # NAME SHARD HTTP TCP INTERSERVER
  local at=$home/$1
  mkdir -p "$at/data" "$at/tmp" "$at/user_files" "$at/format_schemas"
  cat >"$at/config.xml" <<EOF
<?xml version="1.0"?>
<yandex>
  <logger><level>information</level><log>$at/server.log</log><errorlog>$at/error.log</errorlog><size>20M</size><count>2</count></logger>
  <listen_host>127.0.0.1</listen_host>
  <http_port>$3</http_port><tcp_port>$4</tcp_port>
  <interserver_http_host>127.0.0.1</interserver_http_host><interserver_http_port>$5</interserver_http_port>
  <path>$at/data/</path><tmp_path>$at/tmp/</tmp_path><user_files_path>$at/user_files/</user_files_path>
  <format_schema_path>$at/format_schemas/</format_schema_path>
  <users_config>$at/users.xml</users_config><default_profile>default</default_profile><default_database>default</default_database>
  <max_connections>128</max_connections><keep_alive_timeout>10</keep_alive_timeout><max_concurrent_queries>64</max_concurrent_queries>
  <uncompressed_cache_size>0</uncompressed_cache_size><mark_cache_size>67108864</mark_cache_size>
  <remote_servers><pliant>
$(write_shards)
  </pliant></remote_servers>
  <zookeeper><node><host>127.0.0.1</host><port>$(cat "$home/zookeeper/port")</port></node><session_timeout_ms>10000</session_timeout_ms></zookeeper>
  <macros><shard>$2</shard><replica>$1</replica></macros>
  <distributed_ddl><path>/clickhouse/task_queue/ddl</path></distributed_ddl>
</yandex>
EOF
  cat >"$at/users.xml" <<EOF
<?xml version="1.0"?>
<yandex>
  <profiles><default>
    <max_memory_usage>1000000000</max_memory_usage><max_threads>2</max_threads><min_compress_block_size>8192</min_compress_block_size>
    <background_schedule_pool_size>4</background_schedule_pool_size><connect_timeout_with_failover_ms>200</connect_timeout_with_failover_ms>
    <log_queries>0</log_queries>
  </default></profiles>
  <users><default><password></password><networks><ip>127.0.0.1</ip></networks><profile>default</profile><quota>default</quota></default></users>
  <quotas><default></default></quotas>
</yandex>
EOF
}

plan() {  # SHARDS REPLICAS : chooses ports, once for a folder: the tables remember them
  local ports shard replica at=1
  [[ $1 =~ ^[1-9]$ && $2 =~ ^[1-9]$ ]] || fail "shards and replicas are 1 to 9"
  mapfile -t ports < <(free_ports $((1 + 3 * $1 * $2)))
  mkdir -p "$home/zookeeper"
  echo "${ports[0]}" >"$home/zookeeper/port"
  for shard in $(seq "$1"); do
    for replica in $(seq "$2"); do
      echo "s${shard}r$replica $shard ${ports[at]} ${ports[at + 1]} ${ports[at + 2]}"
      at=$((at + 3))
    done
  done >"$home/nodes.new"
  mv "$home/nodes.new" "$home/nodes"
}

# "ruok" is answered before the data are loaded, and servers that start then give up.
keeper_answers() {
  local answer
  { exec 3<>"/dev/tcp/127.0.0.1/$(cat "$home/zookeeper/port")"; } 2>/dev/null || return 1
  echo srvr >&3 2>/dev/null || true
  answer=$(timeout 2 cat <&3 || true)
  exec 3>&-
  [[ $answer == *Mode:* ]]
}

answers() { [ "$(curl -s -m 3 --noproxy '*' "http://127.0.0.1:$1/ping" || true)" = Ok. ]; }

start_keeper() {
  if pid_of zookeeper >/dev/null; then return; fi
  write_keeper "$(cat "$home/zookeeper/port")"
  setsid java -Xmx192m -XX:+UseSerialGC -cp "/etc/zookeeper/conf_example:/usr/share/java/zookeeper.jar" \
    -Dzookeeper.log.dir="$home/zookeeper" -Dzookeeper.root.logger=WARN,CONSOLE \
    org.apache.zookeeper.server.quorum.QuorumPeerMain "$home/zookeeper/zoo.cfg" \
    >"$home/zookeeper/out.log" 2>&1 </dev/null 9>&- &
  echo $! >"$home/zookeeper/pid"
}

start_node() {
  if pid_of "$1" >/dev/null; then return; fi
  write_node "$@"
  LD_LIBRARY_PATH=$libraries setsid clickhouse-server --config-file="$home/$1/config.xml" >"$home/$1/out.log" 2>&1 </dev/null 9>&- &  # the lock is this script's
  echo $! >"$home/$1/pid"
}

wait_for() {  # NAME COMMAND... : at most 90 seconds, less when the process has ended
  local name=$1
  shift
  for _ in $(seq 450); do
    "$@" && return 0
    pid_of "$name" >/dev/null || break
    sleep 0.2
  done
  tail -n 5 "$home/$name/error.log" "$home/$name/out.log" >&2 2>/dev/null || true
  return 1
}

url() {
  echo "clickhouse://$(awk '{ printf "%s127.0.0.1:%s", (NR > 1 ? "," : ""), $3 }' "$home/nodes")/pliant?keeper=127.0.0.1:$(cat "$home/zookeeper/port")&cluster=pliant"
}

check_packages() {
  local program
  for program in clickhouse-server java curl; do
    command -v "$program" >/dev/null || { echo "cluster_local.sh: $program is missing: apt-get install clickhouse-server libzookeeper-java default-jre-headless curl" >&2; exit 77; }
  done
  [ -e /usr/share/java/zookeeper.jar ] || { echo "cluster_local.sh: ZooKeeper is missing: apt-get install libzookeeper-java" >&2; exit 77; }
}

up() {
  local started=
  check_packages
  [ -s "$home/nodes" ] && [ -s "$home/zookeeper/port" ] || plan "${1:-2}" "${2:-2}"
  # What this call started goes again when not all of it answers, also after Ctrl-C.
  trap 'status=$?; if [ "$status" -ne 0 ] && [ -n "$started" ]; then stop $started; fi' EXIT
  trap 'exit 130' INT TERM
  pid_of zookeeper >/dev/null || started=zookeeper
  start_keeper
  wait_for zookeeper keeper_answers || fail "ZooKeeper does not answer; see $home/zookeeper"
  while read -r name shard http tcp interserver; do
    pid_of "$name" >/dev/null || started="$name $started"
    start_node "$name" "$shard" "$http" "$tcp" "$interserver"
  done < <(nodes)
  while read -r name _ http _; do
    wait_for "$name" answers "$http" || fail "$name does not answer; see $home/$name"
  done < <(nodes)
  url
}

status() {
  local all=0 state name http
  check_packages
  [ -s "$home/nodes" ] || fail "there is no cluster in $home; make one with: cluster_local.sh up $home"
  state=answers; keeper_answers || { state="does not answer"; all=1; }
  echo "zookeeper  127.0.0.1:$(cat "$home/zookeeper/port")  $state"
  while read -r name _ http _; do
    state=answers; answers "$http" || { state="does not answer"; all=1; }
    echo "$name       127.0.0.1:$http  $state"
  done < <(nodes)
  url
  return "$all"
}

exec 9>"$home/lock"
if [ "$action" = remove ]; then
  flock -w 10 9 || true  # an `up` whose caller has ended may wait for a node that never answers
else
  flock -w 120 9 || fail "another cluster_local.sh works in $home"
fi
case $action in
  up) up "${@:3}" ;;
  status) status ;;
  down) stop $(nodes | cut -d' ' -f1); stop zookeeper ;;
  remove)
    kill_now $(nodes | cut -d' ' -f1) zookeeper
    for name in $(nodes | cut -d' ' -f1) zookeeper; do rm -rf "${home:?}/$name"; done
    rm -f "$home/nodes" "$home/lock"
    rmdir "$home" 2>/dev/null || true  # unless something else is there
    ;;
  *) usage ;;
esac
