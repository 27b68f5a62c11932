// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Output of `pliant`: one JSON document or text on standard output, messages on standard error.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "descriptor/base/error.h"
#include "index/engine/engine.h"
#include "index/json/json.h"

namespace pliant::cli {

// The one place where errors become exit statuses of `pliant`.
enum class ExitStatus {
  kDone = 0,
  kFailed = 1,
  kWrongUsage = 2,
  kSomeSkipped = 3,  // done, but some inputs were skipped; each was named with its reason
};

inline ExitStatus ToExitStatus(ErrorCode code) {
  return code == ErrorCode::kInvalidArgument ? ExitStatus::kWrongUsage : ExitStatus::kFailed;
}

void Print(std::string_view text);     // a line on standard output
void PrintJson(const Json& document);  // the same
void Message(std::string_view text);   // a line on standard error
// The place of a file that is called "-". To be called before the work whose result is written:
// from then on Print writes to standard error. `flag` is for the message. Throws kInvalidArgument
// "output_taken" where another file or a JSON document (`json`) goes there too, or it is a
// terminal.
void ClaimStandardOutput(std::string_view flag, bool json);
void FlushOutput();  // throws kNoSpace when standard output cannot be written
// "pliant: what" on standard error and, when `json`, {"error": {"code", "message"}} on standard
// output.
void ReportError(const Error& error, bool json);

// Columns as wide as their widest cell (in code points); numeric columns are right-aligned.
std::string FormatTable(const std::vector<std::string>& header,
                        const std::vector<std::vector<std::string>>& rows);

std::string FormatTime(std::int64_t unix_ms);  // "2025-01-31 13:45:10" UTC
std::string FormatFixed(double value, int decimals);
// A field of a CSV file (RFC 4180): in quotes where it has a comma, a quote or a line break.
std::string CsvField(const std::string& text);

// VocabularyJson, and with the names that the command line gave first: "created_ms" and
// "origin": {"method", "seed", "sampled", "available", "loss"}.
Json VocabularyDocument(const VocabularyRecord& record);

}  // namespace pliant::cli
