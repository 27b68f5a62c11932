#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# on_cluster.sh COMMAND...: runs it with PLIANT_TEST_CLUSTER, the URL of a fresh cluster of two shards of two
# replicas on this machine, and PLIANT_TEST_CLUSTER_HOME, its folder; both go afterwards. Exit status 77 where the packages are not installed.
# PLIANT_TEST_SMALL_DISK=s1r2: that node's data are on a disk of their own of 3 GiB, in memory, which nobody else sees.
# Where the system does not allow that, the variable is taken away.
set -euo pipefail
if [ -n "${PLIANT_TEST_SMALL_DISK:-}" ] && [ -z "${PLIANT_TEST_OWN_MOUNTS:-}" ]; then
  if unshare --mount --map-root-user sh -c 'mount -t tmpfs tmpfs /tmp' 2>/dev/null; then
    PLIANT_TEST_OWN_MOUNTS=1 exec unshare --mount --map-root-user bash "$0" "$@"
  fi
  echo "on_cluster.sh: no disk can be mounted here, so none is full"
  unset PLIANT_TEST_SMALL_DISK
fi
local=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../docker" && pwd)/cluster_local.sh
home=$(mktemp -d "${TMPDIR:-/tmp}/pliant-cluster-XXXXXX")
small=${PLIANT_TEST_SMALL_DISK:+$home/$PLIANT_TEST_SMALL_DISK/data}
# Nobody needs the data any more: what is stopped in order takes half a minute.
trap 'bash "$local" remove "$home" >/dev/null 2>&1 || true; if [ -n "$small" ]; then umount -l "$small" || true; fi; rm -rf "$home"' EXIT
if [ -n "$small" ]; then
  mkdir -p "$small"
  mount -t tmpfs -o size=3g tmpfs "$small"
fi
said=$(bash "$local" up "$home") || exit $?
PLIANT_TEST_CLUSTER=$(grep -o 'clickhouse://[^ ]*' <<<"$said" | tail -1)
export PLIANT_TEST_CLUSTER PLIANT_TEST_CLUSTER_HOME=$home
"$@"
