#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# http_suite.sh BIN [TEST...]: the tests of the HTTP interface on PostgreSQL, each database a schema of its own; a line each.
# Left out are tests that look into the file or concern it alone: server_backups_test, server_job_scopes_test, restore_test,
# server_slow_store_test; those that need a backup to begin with (the fixture of server_openapi_test, server_refusals_test,
# openapi_fuzz_test); and what is the same whatever the database: connections, TLS, fetching, decoders.
set -euo pipefail
bin=$(cd "$1" && pwd)
shift
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
tests=("$@")
if [ ${#tests[@]} -eq 0 ]; then
  tests=(server_test server_aliases_test server_auth_test server_bulk_test server_changes_test server_chunked_import_test
    server_compare_test server_conditions_test server_errors_test server_export_test server_files_test server_import_test
    server_large_import_test server_lists_test server_load_test server_locate_test server_repeatable_test server_search_test
    server_similar_test server_waiting_test)
fi
if [ -z "${PLIANT_TEST_DATABASE:-}" ]; then exec bash "$here/on_postgres.sh" bash "$0" "$bin" "${tests[@]}"; fi
of_files=(
  ServerTest.AFullDiskIsNoReasonToSearchInVain       # limits the server's files
  BulkTest.ABackupMadeUnderLoadCanBeRestored         # copies the file
  AuthTest.ANewDatabaseIsMentionedOnceAndOnlyMadeForAKey  # names it
  # They look at the files of uploads beside the database.
  ChunkedImportTest.WhoGoesBeforeTheEndLeavesNothing
  LargeImportTest.WhoGoesBeforeTheEndLeavesNothing LargeImportTest.GoesOnAfterKill
  LargeImportTest.ACancelledOneIsGoneAndOneWithoutItsFileFails
)
filter=$(IFS=:; echo "-${of_files[*]}")
failed=0
for test in "${tests[@]}"; do
  log=$(mktemp)
  if timeout 900 "$bin/$test" --gtest_brief=1 --gtest_filter="$filter" >"$log" 2>&1; then
    echo "$test: $(grep -o '[0-9]* tests* from .* ran.*' "$log" | tail -1)"
  else
    failed=1
    echo "$test: FAILED: $(grep -o '\[  FAILED  \] [A-Za-z]*[.][A-Za-z0-9_]*' "$log" | sort -u | sed 's/.*] //' | tr '\n' ' ')"
    cat "$log"
  fi
  rm -f "$log"
done
exit "$failed"
