// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/json/record_csv.h"

#include <algorithm>

namespace pliant {
std::string CsvField(const std::string& text) {
  if (text.find_first_of("\",;\t\r\n") == std::string::npos) return text;
  std::string field = "\"";
  for (const char c : text) field += c == '"' ? std::string("\"\"") : std::string(1, c);
  return field + '"';
}

std::string CsvRow(const ImageRecord& image) {
  return CsvField(image.id) + ',' + CsvField(image.object) + ',' + CsvField(image.source) + ',' +
         (image.metadata == "{}" ? "" : CsvField(image.metadata)) + "\r\n";
}

std::optional<std::vector<std::string_view>> CsvRows(std::string_view text) {
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  std::vector<std::string_view> rows;
  bool quoted = false;
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= text.size(); ++i) {
    if (i < text.size() && text[i] == '"') quoted = !quoted;  // two inside quotes: a quote
    if (i < text.size() && (quoted || (text[i] != '\n' && text[i] != '\r'))) continue;
    if (i > begin) rows.push_back(text.substr(begin, i - begin));
    begin = i + 1;
  }
  if (quoted) return std::nullopt;
  return rows;
}

char SeparatorOf(std::string_view first_row) {
  const auto count = [&](char c) { return std::ranges::count(first_row, c); };
  return std::max({',', ';', '\t'}, [&](char a, char b) { return count(a) < count(b); });
}

std::vector<std::string> CsvFields(std::string_view row, char separator) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (std::size_t i = 0; i < row.size(); ++i) {
    if (row[i] == '"') {
      if (quoted && i + 1 < row.size() && row[i + 1] == '"') {
        fields.back() += row[i++];
      } else {
        quoted = !quoted;
      }
    } else if (row[i] == separator && !quoted) {
      fields.emplace_back();
    } else {
      fields.back() += row[i];
    }
  }
  return fields;
}

}  // namespace pliant
