#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# on_cluster.sh COMMAND...: runs it with PLIANT_TEST_CLUSTER, the URL of a fresh cluster of two shards of two
# replicas on this machine, and PLIANT_TEST_CLUSTER_HOME, its folder; both go afterwards. Exit status 77 where the packages are not installed.
set -euo pipefail
local=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../docker" && pwd)/cluster_local.sh
home=$(mktemp -d "${TMPDIR:-/tmp}/pliant-cluster-XXXXXX")
trap 'bash "$local" down "$home" >/dev/null 2>&1 || true; rm -rf "$home"' EXIT
said=$(bash "$local" up "$home") || exit $?
PLIANT_TEST_CLUSTER=$(grep -o 'clickhouse://[^ ]*' <<<"$said" | tail -1)
export PLIANT_TEST_CLUSTER PLIANT_TEST_CLUSTER_HOME=$home
"$@"
