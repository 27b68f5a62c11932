// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/postgres/filter_sql.h"

#include <map>

#include <nlohmann/json.hpp>

#include "descriptor/base/strings.h"
#include "descriptor/base/utf8.h"
#include "index/files/text.h"
#include "index/records/filter_value.h"
#include "index/store/facet_count.h"

namespace pliant::postgres {
namespace {

using Json = nlohmann::json;

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
          return EscapedNul(one);
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
             query_.Bind(EscapedNul(*text)) + " ELSE FALSE END";
    }
    return "CASE jsonb_typeof(e.x) WHEN 'number' THEN CAST(e.x #>> '{}' AS numeric)" + compare +
           "CAST(" + query_.Bind(JsonOf(bound.value).dump()) + " AS numeric) ELSE FALSE END";
  }

  // In any case, as FoldCase does it. `where`: the place, from 1.
  std::string Occurs(const std::string& text, const char* where) {
    return "CASE jsonb_typeof(e.x) WHEN 'string' THEN strpos(lower(upper((e.x #>> '{}') COLLATE "
           "pliant_fold)), " +
           query_.Bind(EscapedNul(EncodeUtf8(FoldCase(text)))) + ") " + where + " ELSE FALSE END";
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
    if (condition.prefix) tests.push_back(Occurs(*condition.prefix, "= 1"));
    if (condition.contains) tests.push_back(Occurs(*condition.contains, "> 0"));
    return "EXISTS (SELECT 1 FROM jsonb_array_elements(CASE jsonb_typeof(" + value +
           ") WHEN 'array' THEN " + value + " ELSE jsonb_build_array(" + value +
           ") END) AS e(x) WHERE " + InBrackets(tests, " AND ") + ")";
  }

  std::string One(const FilterCondition& condition) {
    const std::string key = EscapedNul(condition.key);
    const std::string value = "(" + fields_ + " -> " + query_.Bind(key) + ")";
    if (condition.exists && !*condition.exists) return "(" + value + " IS NULL)";
    std::vector<std::string> parts{value + " IS NOT NULL"};
    if (condition.not_equal) parts.push_back("NOT " + Has(key, *condition.not_equal));
    const bool only_equality =
        !(condition.from || condition.to || condition.prefix || condition.contains);
    if (condition.any_of && only_equality) {
      parts.push_back(HasAny(key, *condition.any_of));
    } else if (condition.tests_entries()) {
      parts.push_back(EntryPasses(condition, value));
    }
    return InBrackets(parts, " AND ");
  }

  Query& query_;
  const std::string fields_;
};

}  // namespace

Facet CountFacet(Connection& db, const Query& listed, const std::string& key) {
  Query query = listed;
  const std::string value = "(metadata -> " + query.Bind(EscapedNul(key)) + ")";
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

std::string NaturalKeySql(const std::string& text) {
  return "(SELECT string_agg(m[1] || CASE m[2] WHEN '' THEN '' ELSE "
         "lpad(CAST(length(ltrim(m[2], '0')) AS text), 5, '0') || ltrim(m[2], '0') END, '') "
         "FROM regexp_matches(" +
         text + ", '([^0-9]*)([0-9]*)', 'g') m) COLLATE \"C\"";
}

std::string MetadataOrderSql(Query& query, const std::string& table, const std::string& key) {
  const std::string value = table + ".fields -> " + query.Bind(EscapedNul(key));
  const std::string number = "(CAST(v #>> '{}' AS double precision) + 0)";
  const std::string bits = "encode(float8send(" + number + "), 'hex')";
  return "(SELECT CASE jsonb_typeof(v) WHEN 'boolean' THEN '1' || left(v #>> '{}', 1) "
         "WHEN 'number' THEN CASE WHEN " +
         number + " < 0 THEN '2n' || translate(" + bits +
         ", '0123456789abcdef', 'fedcba9876543210') ELSE '2p' || " + bits +
         " END WHEN 'string' THEN '3' || " + NaturalKeySql("v #>> '{}'") +
         " ELSE '0' END FROM (SELECT " + value + " AS v) AS one) COLLATE \"C\"";
}

}  // namespace pliant::postgres
