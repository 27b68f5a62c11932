// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Answers of ClickHouse, in one piece and in two. The first byte of an input chooses the columns
// that are expected, the next two where it is split.
#include <algorithm>
#include <array>
#include <optional>

#include "index/store/clickhouse/native_reader.h"
#include "tests/fuzz/fuzz.h"

namespace {

using namespace pliant::clickhouse;
using pliant::fuzz::Require;

constexpr NativeLimits kLimits{.rows = 5000, .block_bytes = 20000};

std::vector<NativeField> Fields(std::uint8_t choice) {
  static constexpr std::array kTypes = {
      "UInt8",  "Int16",          "UInt32",        "UInt64",        "Int64",
      "String", "FixedString(3)", "Array(String)", "Array(UInt32)", "Array(FixedString(2))",
      "Float64"};
  std::vector<NativeField> fields;
  for (std::size_t i = 0; i < kTypes.size(); ++i) {
    if (choice < kTypes.size() && choice != i) continue;  // one column, or all
    fields.push_back({"c" + std::to_string(i), ParseNativeType(kTypes[i])});
  }
  return fields;
}

void CheckSize(const NativeBlock& block, const std::vector<NativeField>& fields) {
  Require(block.rows > 0 && block.rows <= kLimits.rows,
          "a block has rows, and no more than allowed");
  Require(block.columns.size() == fields.size(), "a block has the columns that were asked for");
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < fields.size(); ++i) {
    Require(block.columns[i].field == fields[i], "each is the one that was asked for");
    bytes += block.columns[i].ends.size() * sizeof(std::uint64_t);
    std::visit([&](const auto& values) { bytes += values.size() * sizeof(values[0]); },
               block.columns[i].values);
  }
  Require(bytes <= kLimits.block_bytes * sizeof(std::string), "a block has no more bytes");
}

// The blocks as they would be written; nothing when the answer is refused.
std::optional<std::string> Read(const std::vector<NativeField>& fields, std::string_view text,
                                std::size_t split) {
  NativeReader reader(fields, kLimits);
  std::string blocks;
  const bool accepted = pliant::fuzz::Accepts([&] {
    for (const std::string_view piece : {text.substr(0, split), text.substr(split)}) {
      reader.Take(piece);
      for (NativeBlock block; reader.Next(block);) {
        CheckSize(block, fields);
        blocks += EncodeNative(block);
      }
    }
    reader.Finish();
  });
  return accepted ? std::optional(blocks) : std::nullopt;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  pliant::fuzz::Input input(data, size);
  const std::vector<NativeField> fields = Fields(pliant::fuzz::TakeByte(input) % 12);
  const std::size_t high = pliant::fuzz::TakeByte(input);
  const std::size_t low = pliant::fuzz::TakeByte(input);
  const std::string_view text = pliant::fuzz::TextOf(input);
  const std::optional<std::string> whole = Read(fields, text, text.size());
  Require(Read(fields, text, std::min(high * 256 + low, text.size())) == whole,
          "in two pieces it is the same");
  if (whole) Require(Read(fields, *whole, whole->size()) == whole, "what is written is read");
  return 0;
}
