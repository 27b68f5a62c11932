#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# Runs once, when the image of PostgreSQL makes the data of the primary: the role and the database of Pliant, and the right to
# replicate for the superuser, from other machines with its password.
set -euo pipefail
psql -q -v ON_ERROR_STOP=1 -v password="$PLIANT_DB_PASSWORD" <<'SQL'
SET synchronous_commit = local;  -- there is no standby yet
CREATE ROLE pliant LOGIN PASSWORD :'password' IN ROLE pg_monitor;  -- which sees how far behind a standby is
CREATE DATABASE pliant OWNER pliant;
SQL
echo 'host replication postgres all scram-sha-256' >>"$PGDATA/pg_hba.conf"
