// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Names and labels of images as a table for spreadsheets: CSV (RFC 4180) with the columns id,
// object, file (the source) and labels (the metadata, a JSON object; empty = {}).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "index/records/records.h"

namespace pliant {

inline constexpr const char* kCsvType = "text/csv";
inline constexpr const char* kCsvHeader = "id,object,file,labels\r\n";

std::string CsvRow(const ImageRecord& image);
// A field of any table: in quotes if it has a separator, a quote or a line break.
std::string CsvField(const std::string& text);

// The rows as they are in `text`, without empty ones, a byte order mark and line ends. Nothing if a
// quote is not closed.
std::optional<std::vector<std::string_view>> CsvRows(std::string_view text);
// The fields of a row. `separator`: what SeparatorOf(first row) gives, as spreadsheets of some
// languages write semicolons or tabs.
std::vector<std::string> CsvFields(std::string_view row, char separator);
char SeparatorOf(std::string_view first_row);

}  // namespace pliant
