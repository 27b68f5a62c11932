// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Output of `pliant`: one JSON document or text on standard output, messages on standard error.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "descriptor/base/error.h"
#include "index/engine/engine.h"
#include "index/files/image_files.h"
#include "index/json/json.h"
#include "index/usage/usage.h"

namespace pliant::cli {

void Print(std::string_view text);     // a line on standard output
void PrintJson(const Json& document);  // the same
void Message(std::string_view text);   // a line on standard error

// The same with values in the text: Print("found {} of {}", found, all).
template <typename First, typename... Rest>
void Print(fmt::format_string<First, Rest...> text, First&& first, Rest&&... rest) {
  Print(fmt::format(text, std::forward<First>(first), std::forward<Rest>(rest)...));
}
template <typename First, typename... Rest>
void Message(fmt::format_string<First, Rest...> text, First&& first, Rest&&... rest) {
  Message(fmt::format(text, std::forward<First>(first), std::forward<Rest>(rest)...));
}

// The result of a command: `document` with --json, otherwise a line.
template <typename First, typename... Rest>
void Report(bool json, const Json& document, fmt::format_string<First, Rest...> text, First&& first,
            Rest&&... rest) {
  Print(json ? ToText(document)
             : fmt::format(text, std::forward<First>(first), std::forward<Rest>(rest)...));
}

// Reserves standard output for a file that is called "-". Call it before the work whose result is
// written: from then on Print writes to standard error. `flag` is for the message. Throws
// kInvalidArgument "output_taken" if another file or a JSON document (`json`) goes there too, or if
// standard output is a terminal.
void ClaimStandardOutput(std::string_view flag, bool json);
void FlushOutput();  // throws kNoSpace when standard output cannot be written
// "pliant: what" on standard error and, when `json`, {"error": {"code", "message"}} on standard
// output. With the flags of the command of `program` that was given.
void ReportError(const Error& error, const CLI::App& program, bool json);

// "skipped a.png: ..." on standard error.
void ReportSkipped(const std::vector<SkippedFile>& skipped);
Json SkippedJson(const std::vector<SkippedFile>& skipped);  // [{"file", "code", "reason"}]

std::string PathText(const std::filesystem::path& path);  // for messages and JSON
std::string FormatFixed(double value, int decimals);

// Columns as wide as their widest cell (in code points); numeric columns are right-aligned.
std::string FormatTable(const std::vector<std::string>& header,
                        const std::vector<std::vector<std::string>>& rows);

// How a report in JSON is written as a table or as CSV: a field of its rows, by JSON pointer
// ("/spread/map"), the title of its column, and the decimals of fractions.
struct Column {
  std::string field;
  std::string title;
  int decimals = 3;
};

// `rows`: a list of objects. A null is "-".
std::string TableOf(const Json& rows, const std::vector<Column>& columns);
// A line of titles, then one line per row. A null is empty.
std::string CsvOf(const Json& rows, const std::vector<Column>& columns);

}  // namespace pliant::cli
