#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# standby.sh COMMAND...: copies the primary (PGHOST, PGUSER, PGPASSWORD) to PGDATA unless that exists, and runs the command.
set -euo pipefail
if [ ! -e "$PGDATA" ]; then
  rm -rf "$PGDATA.new"  # of a copy that was interrupted
  pg_basebackup -D "$PGDATA.new" --checkpoint=fast --write-recovery-conf
  mv "$PGDATA.new" "$PGDATA"
fi
exec "$@"
