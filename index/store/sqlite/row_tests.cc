// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/row_tests.h"

#include <exception>
#include <stdexcept>
#include <string_view>

#include <SQLiteCpp/Exception.h>
#include <sqlite3.h>

#include "index/files/fold_case.h"
#include "index/records/filter.h"

namespace pliant {
namespace {

std::string_view TextOf(sqlite3_value* value) {
  const auto* text = reinterpret_cast<const char*>(sqlite3_value_text(value));  // NULL: none
  if (text == nullptr) return {};
  return {text, static_cast<std::size_t>(sqlite3_value_bytes(value))};
}

// No exception may pass through SQLite.
template <typename Test>
void Answer(sqlite3_context* context, const Test& test) noexcept {
  try {
    sqlite3_result_int(context, test() ? 1 : 0);
  } catch (const std::exception& error) {
    sqlite3_result_error(context, error.what(), -1);
  }
}

template <typename Value>
const Value& Bound(sqlite3_context* context, sqlite3_value* value, const char* type) {
  const auto& all = *static_cast<const BoundPointers*>(sqlite3_user_data(context));
  const SqlPointer& bound = all.at(sqlite3_value_int64(value));
  if (std::string_view(bound.type) != type)
    throw std::invalid_argument("another kind of value is bound");
  return *static_cast<const Value*>(bound.value.get());
}

void PassesFunction(sqlite3_context* context, int /*count*/, sqlite3_value** values) {
  Answer(context, [&] {
    return Passes(Bound<Filter>(context, values[1], kFilterPointer), TextOf(values[0]));
  });
}

void ContainsFunction(sqlite3_context* context, int count, sqlite3_value** values) {
  Answer(context, [&] {
    std::vector<std::string_view> texts;
    for (int i = 1; i < count; ++i) texts.push_back(TextOf(values[i]));
    return count > 0 && OccurIn(Bound<FoldedText>(context, values[0], kWordsPointer), texts);
  });
}

}  // namespace

void AddRowTests(sqlite3* connection, BoundPointers* bound) {
  // Not "deterministic": what they look for changes from statement to statement.
  constexpr int kHow = SQLITE_UTF8 | SQLITE_DIRECTONLY;
  const auto add = [&](const char* name, int arguments, auto* function) {
    const int code = sqlite3_create_function_v2(connection, name, arguments, kHow, bound, function,
                                                nullptr, nullptr, nullptr);
    if (code != SQLITE_OK) throw SQLite::Exception(connection, code);
  };
  add("pliant_passes", 2, &PassesFunction);
  add("pliant_contains", -1, &ContainsFunction);
}

}  // namespace pliant
