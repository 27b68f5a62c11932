// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/output.h"

#include <algorithm>
#include <iostream>

#include <unistd.h>

#include "descriptor/base/strings.h"
#include "index/cli/progress.h"
#include "index/files/text.h"
#include "index/json/record_csv.h"
#include "index/usage/usage.h"

namespace pliant::cli {
namespace {

std::size_t Width(std::string_view text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xC0) != 0x80;
  }));
}

bool IsNumber(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789.-") == std::string::npos;
}

std::string Cell(const Json& row, const Column& column, const std::string& none) {
  const Json& value = row.at(Json::json_pointer(column.field));
  if (value.is_null()) return none;
  if (value.is_number_float()) return FormatFixed(value.get<double>(), column.decimals);
  return value.is_string() ? value.get<std::string>() : value.dump();
}

bool standard_output_is_file = false;  // set once, before any output

}  // namespace

void Print(std::string_view text) {
  ClearProgress();
  (standard_output_is_file ? std::cerr : std::cout) << text << '\n';
}

void ClaimStandardOutput(std::string_view flag, bool json) {
  const auto refuse = [flag](const char* why) {
    throw Error(ErrorCode::kInvalidArgument, "output_taken", fmt::format("{} - {}", flag, why));
  };
  if (json) refuse("and --json would both write to standard output");
  if (standard_output_is_file) refuse("and another option would both write to standard output");
  if (::isatty(STDOUT_FILENO) != 0) {
    refuse("writes to standard output, which is a terminal: redirect it to a file or a program");
  }
  standard_output_is_file = true;
}

void PrintJson(const Json& document) { Print(ToText(document)); }

void Message(std::string_view text) {
  ClearProgress();
  std::cerr << text << std::endl;
}

void FlushOutput() {
  std::cout.flush();
  if (!std::cout) {
    throw Error(ErrorCode::kNoSpace, "output_failed", "cannot write to standard output");
  }
}

void ReportError(const Error& error, const CLI::App& program, bool json) {
  std::string message = ToDisplayText(WithFlagNames(error, &program));
  if (error.reason() == "database_not_found")
    message += "; `pliant index DIR --db FILE` creates one";
  if (error.reason() == "no_vocabulary") {
    message +=
        ": `pliant index` makes one when it has added its images, and `pliant vocab train` "
        "at any time";
  }
  Message("pliant: {}", message);
  if (!json) return;
  PrintJson({{"error", {{"code", error.reason()}, {"message", message}}}});
  std::cout.flush();
}

std::string FormatTable(const std::vector<std::string>& header,
                        const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  std::vector<bool> numeric;
  for (std::size_t c = 0; c < header.size(); ++c) {
    widths.push_back(Width(header[c]));
    numeric.push_back(true);
    for (const auto& row : rows) {
      widths[c] = std::max(widths[c], Width(row[c]));
      numeric[c] = numeric[c] && IsNumber(row[c]);
    }
  }
  std::string out;
  const auto add_row = [&](const std::vector<std::string>& row) {
    std::string line;
    for (std::size_t c = 0; c < row.size(); ++c) {
      const std::string space(widths[c] - Width(row[c]), ' ');
      if (c > 0) line += "  ";
      line += numeric[c] ? space + row[c] : row[c] + space;
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out += line + '\n';
  };
  add_row(header);
  for (const auto& row : rows) add_row(row);
  if (!out.empty()) out.pop_back();
  return out;
}

std::string FormatFixed(double value, int decimals) {
  return fmt::format("{:.{}f}", value, decimals);
}

std::string TableOf(const Json& rows, const std::vector<Column>& columns) {
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> cells(rows.size());
  for (const Column& column : columns) {
    header.push_back(column.title);
    for (std::size_t i = 0; i < rows.size(); ++i) cells[i].push_back(Cell(rows[i], column, "-"));
  }
  return FormatTable(header, cells);
}

std::string CsvOf(const Json& rows, const std::vector<Column>& columns) {
  std::vector<std::string> fields;
  for (const Column& column : columns) fields.push_back(column.title);
  std::string csv = Join(fields, ",") + '\n';
  for (const Json& row : rows) {
    fields.clear();
    for (const Column& column : columns) fields.push_back(CsvField(Cell(row, column, "")));
    csv += Join(fields, ",") + '\n';
  }
  return csv;
}

std::string PathText(const std::filesystem::path& path) { return ToDisplayText(path.string()); }

void ReportSkipped(const std::vector<SkippedFile>& skipped) {
  for (const SkippedFile& s : skipped) Message("skipped {}: {}", s.file, s.reason);
}

Json SkippedJson(const std::vector<SkippedFile>& skipped) {
  Json list = Json::array();
  for (const SkippedFile& s : skipped) {
    list.push_back({{"file", s.file}, {"code", s.code}, {"reason", s.reason}});
  }
  return list;
}

}  // namespace pliant::cli
