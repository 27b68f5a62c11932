// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Filters and counts of metadata as SQL on the column `fields` (schema.cc). Private to
// store/postgres.
#pragma once

#include <string>

#include "index/records/filter.h"
#include "index/store/sql/connection.h"

namespace pliant::postgres {

// True or false for each row of `images`, which the query names `table`; the same as Passes
// (filter.h). Equality is looked up in the index on `fields`.
std::string FilterSql(Query& query, const std::string& table, const Filter& filter);

// NaturalKey (index/files/text.h) and MetadataOrder (filter.h) as SQL.
std::string NaturalKeySql(const std::string& text);
std::string MetadataOrderSql(Query& query, const std::string& table, const std::string& key);

// Connection::CountFacets, of one key.
Facet CountFacet(Connection& db, const Query& listed, const std::string& key);

}  // namespace pliant::postgres
