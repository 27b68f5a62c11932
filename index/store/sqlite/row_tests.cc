// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/sqlite/row_tests.h"

#include <exception>
#include <new>
#include <string_view>

#include <SQLiteCpp/Exception.h>
#include <sqlite3.h>

#include "index/files/fold_case.h"
#include "index/store/sqlite/connection.h"

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
  } catch (const std::bad_alloc&) {
    sqlite3_result_error_nomem(context);
  } catch (const std::exception& error) {
    sqlite3_result_error(context, error.what(), -1);
  }
}

const RowTests& TestsOf(sqlite3_context* context) {
  return *static_cast<const RowTests*>(sqlite3_user_data(context));
}

void PassesFunction(sqlite3_context* context, int /*count*/, sqlite3_value** values) {
  Answer(context, [&] {
    const RowTests& tests = TestsOf(context);
    return tests.filter == nullptr || Passes(*tests.filter, TextOf(values[0]));
  });
}

void ContainsFunction(sqlite3_context* context, int count, sqlite3_value** values) {
  Answer(context, [&] {
    const RowTests& tests = TestsOf(context);
    if (tests.words.empty()) return true;
    std::vector<std::string_view> texts;
    for (int i = 0; i < count; ++i) texts.push_back(TextOf(values[i]));
    return OccurIn(tests.words, texts);
  });
}

}  // namespace

void AddRowTests(sqlite3* connection, RowTests* tests) {
  // Not "deterministic": what they look for changes from statement to statement.
  constexpr int kHow = SQLITE_UTF8 | SQLITE_DIRECTONLY;
  const auto add = [&](const char* name, int arguments, auto* function) {
    const int code = sqlite3_create_function_v2(connection, name, arguments, kHow, tests, function,
                                                nullptr, nullptr, nullptr);
    if (code != SQLITE_OK) throw SQLite::Exception(connection, code);
  };
  add("pliant_passes", 1, &PassesFunction);
  add("pliant_contains", -1, &ContainsFunction);
}

RowTestScope::RowTestScope(Connection& db, const Selection& which) : tests_(db.row_tests()) {
  tests_.words = FoldedWords(which.text);
  tests_.filter = &which.filter;
}

RowTestScope::~RowTestScope() {
  tests_.filter = nullptr;
  tests_.words.clear();
}

}  // namespace pliant
