// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/postgres/filter_sql.h"

#include <map>

#include <nlohmann/json.hpp>

#include "descriptor/base/strings.h"
#include "index/records/filter_value.h"
#include "index/store/facet_count.h"

namespace pliant::postgres {
namespace {

using Json = nlohmann::json;

// PostgreSQL's JSON has no U+0000: as the function pliant_escaped has it (schema.cc). Injective,
// and keeps the order of bytes.
std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\0') {
      escaped += "\1\1";
    } else if (c == '\1') {
      escaped += "\1\2";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string Unescaped(const std::string& text) {
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool escape = text[i] == '\1' && i + 1 < text.size();
    plain += escape ? static_cast<char>(text[++i] - 1) : text[i];
  }
  return plain;
}

Json JsonOf(const FilterValue& value) {
  return std::visit(
      [](const auto& one) -> Json {
        using One = std::decay_t<decltype(one)>;
        if constexpr (std::is_same_v<One, std::monostate>) {
          return nullptr;
        } else if constexpr (std::is_same_v<One, std::string>) {
          return Escaped(one);
        } else {
          return one;
        }
      },
      value);
}

std::string InBrackets(const std::vector<std::string>& parts, const char* with) {
  return "(" + Join(parts, with) + ")";
}

class Writing {
 public:
  Writing(Query& query, const std::string& table) : query_(query), fields_(table + ".fields") {}

  std::string All(const Filter& filter) {
    std::vector<std::string> parts;
    for (const FilterCondition& condition : filter.conditions) parts.push_back(One(condition));
    for (const Filter& part : filter.all_of) parts.push_back(All(part));
    for (const Filter& part : filter.none_of) parts.push_back("NOT " + All(part));
    for (const std::vector<Filter>& several : filter.any_of) {
      std::vector<std::string> either;
      for (const Filter& part : several) either.push_back(All(part));
      parts.push_back(either.empty() ? "FALSE" : InBrackets(either, " OR "));
    }
    return parts.empty() ? "TRUE" : InBrackets(parts, " AND ");
  }

 private:
  std::string BoundJson(const Json& json) {
    return "CAST(" + query_.Bind(json.dump()) + " AS jsonb)";
  }

  // The key has the value, or a list with an entry that is the value.
  std::string Has(const std::string& key, const FilterValue& value) {
    const Json json = JsonOf(value);
    return "(" + fields_ + " @> " + BoundJson(Json{{key, json}}) + " OR " + fields_ + " @> " +
           BoundJson(Json{{key, Json::array({json})}}) + ")";
  }

  std::string HasAny(const std::string& key, const std::vector<FilterValue>& values) {
    std::vector<std::string> parts;
    for (const FilterValue& value : values) parts.push_back(Has(key, value));
    return parts.empty() ? "FALSE" : InBrackets(parts, " OR ");
  }

  std::string Bound(const FilterBound& bound, const char* order) {
    const std::string compare = std::string(" ") + order + (bound.inclusive ? "= " : " ");
    if (const auto* text = std::get_if<std::string>(&bound.value)) {
      return "CASE jsonb_typeof(e.x) WHEN 'string' THEN (e.x #>> '{}') COLLATE \"C\"" + compare +
             query_.Bind(Escaped(*text)) + " ELSE FALSE END";
    }
    return "CASE jsonb_typeof(e.x) WHEN 'number' THEN CAST(e.x #>> '{}' AS numeric)" + compare +
           "CAST(" + query_.Bind(JsonOf(bound.value).dump()) + " AS numeric) ELSE FALSE END";
  }

  // An entry of the value, or the value itself, passes all of the tests.
  std::string EntryPasses(const FilterCondition& condition, const std::string& value) {
    std::vector<std::string> tests;
    if (condition.any_of) {
      std::vector<std::string> equal{"FALSE"};
      for (const FilterValue& one : *condition.any_of) {
        equal.push_back("e.x = " + BoundJson(JsonOf(one)));
      }
      tests.push_back(InBrackets(equal, " OR "));
    }
    if (condition.from) tests.push_back(Bound(*condition.from, ">"));
    if (condition.to) tests.push_back(Bound(*condition.to, "<"));
    return "EXISTS (SELECT 1 FROM jsonb_array_elements(CASE jsonb_typeof(" + value +
           ") WHEN 'array' THEN " + value + " ELSE jsonb_build_array(" + value +
           ") END) AS e(x) WHERE " + InBrackets(tests, " AND ") + ")";
  }

  std::string One(const FilterCondition& condition) {
    const std::string key = Escaped(condition.key);
    const std::string value = "(" + fields_ + " -> " + query_.Bind(key) + ")";
    if (condition.exists && !*condition.exists) return "(" + value + " IS NULL)";
    std::vector<std::string> parts{value + " IS NOT NULL"};
    if (condition.not_equal) parts.push_back("NOT " + Has(key, *condition.not_equal));
    if (condition.from || condition.to) {
      parts.push_back(EntryPasses(condition, value));
    } else if (condition.any_of) {
      parts.push_back(HasAny(key, *condition.any_of));
    }
    return InBrackets(parts, " AND ");
  }

  Query& query_;
  const std::string fields_;
};

}  // namespace

Facet CountFacet(Connection& db, const Query& listed, const std::string& key) {
  Query query = listed;
  const std::string value = "(metadata -> " + query.Bind(Escaped(key)) + ")";
  const std::string from = "FROM (" + listed.sql + ") AS listed ";
  Query items = query;
  items.sql = "SELECT count(DISTINCT item), count(DISTINCT item) FILTER (WHERE " + value +
              " IS NOT NULL) " + from;
  std::uint64_t without = 0;
  {
    Cursor row = db.Prepare(items);
    row.One();
    without = row.Count(0) - row.Count(1);
  }
  // Those that are as frequent as the last one are listed in order of their kinds and values.
  query.sql = "SELECT CAST(e.x AS text), count(DISTINCT item) " + from +
              "CROSS JOIN LATERAL jsonb_array_elements(CASE jsonb_typeof(" + value +
              ") WHEN 'array' THEN " + value + " ELSE jsonb_build_array(" + value +
              ") END) AS e(x) WHERE " + value +
              " IS NOT NULL AND jsonb_typeof(e.x) NOT IN ('array', 'object') "
              "GROUP BY e.x ORDER BY 2 DESC FETCH FIRST " +
              std::to_string(kFacetValues + 1) + " ROWS WITH TIES";
  std::map<FilterValue, std::uint64_t> counts;
  Cursor row = db.Prepare(query);
  while (row.Next()) {
    FilterValue one = *FilterValueOf(Json::parse(row.Text(0)));
    if (auto* text = std::get_if<std::string>(&one)) *text = Unescaped(*text);
    counts.emplace(CanonicalFacetValue(std::move(one)), row.Count(1));
  }
  return MakeFacet(key, counts, without, /*complete=*/true);
}

std::string FilterSql(Query& query, const std::string& table, const Filter& filter) {
  return Writing(query, table).All(filter);
}

}  // namespace pliant::postgres
