// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Native blocks, out and in, whole and in pieces.
#include <gtest/gtest.h>

#include "index/store/clickhouse/native_reader.h"
#include "tests/unit/expect_error.h"

namespace pliant::clickhouse {
namespace {

using pliant::testing::ExpectError;

NativeBlock EveryType() {
  const auto type = [](const char* name) { return ParseNativeType(name); };
  NativeBlock block;
  block.rows = 2;
  block.columns = {
      {{"a", type("UInt8")}, std::vector<std::uint8_t>{0, 255}, {}},
      {{"b", type("Int16")}, std::vector<std::int16_t>{-32768, 7}, {}},
      {{"c", type("UInt32")}, std::vector<std::uint32_t>{1, 4294967295u}, {}},
      {{"d", type("UInt64")}, std::vector<std::uint64_t>{0, ~0ull}, {}},
      {{"e", type("Int64")}, std::vector<std::int64_t>{-1, 1}, {}},
      {{"f", type("Float64")}, std::vector<double>{-0.5, 1e300}, {}},
      {{"g", type("String")}, std::vector<std::string>{"", std::string(300, 'x')}, {}},
      {{"h", type("FixedString(3)")}, std::vector<std::uint8_t>{1, 2, 3, 4, 5, 6}, {}},
      {{"i", type("Array(String)")}, std::vector<std::string>{"p", "q", ""}, {0, 3}},
      {{"j", type("Array(Float64)")}, std::vector<double>{2, 3}, {2, 2}},
      {{"k", type("Array(FixedString(2))")}, std::vector<std::uint8_t>{1, 2, 3, 4}, {1, 2}}};
  return block;
}

std::vector<NativeField> FieldsOf(const NativeBlock& block) {
  std::vector<NativeField> fields;
  for (const NativeColumn& column : block.columns) fields.push_back(column.field);
  return fields;
}

std::vector<NativeBlock> Read(const std::vector<NativeField>& fields, std::string_view bytes,
                              std::size_t piece) {
  NativeReader reader(fields);
  std::vector<NativeBlock> blocks;
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    reader.Take(bytes.substr(at, piece));
    for (NativeBlock block; reader.Next(block);) blocks.push_back(block);
  }
  reader.Finish();
  return blocks;
}

TEST(ClickhouseNative, WhatIsWrittenIsReadFromPiecesOfEverySize) {
  const NativeBlock block = EveryType();
  const std::string bytes = EncodeNative(block) + EncodeNative(block);
  for (std::size_t piece = 1; piece <= bytes.size(); ++piece) {
    const auto blocks = Read(FieldsOf(block), bytes, piece);
    ASSERT_EQ(blocks.size(), 2u) << piece;
    EXPECT_TRUE(blocks[0] == block && blocks[1] == block) << piece;
  }
}

TEST(ClickhouseNative, CutAnywhereIsAnError) {
  const NativeBlock block = EveryType();
  const std::string bytes = EncodeNative(block);
  for (std::size_t size = 1; size < bytes.size(); ++size) {
    ExpectError(ErrorCode::kCorrupt, "answer_corrupt",
                [&] { Read(FieldsOf(block), bytes.substr(0, size), 7); });
  }
}

TEST(ClickhouseNative, BytesOfABlock) {
  const NativeBlock block{
      .rows = 1,
      .columns = {{{"n", ParseNativeType("UInt32")}, std::vector<std::uint32_t>{258}, {}}}};
  EXPECT_EQ(EncodeNative(block), std::string("\x01\x01\x01n\x06UInt32\x02\x01\0\0", 15));
}

TEST(ClickhouseNative, HostileSizesAreRefusedBeforeAnythingIsAllocated) {
  const auto refuse = [](const std::string& type, const std::string& bytes) {
    ExpectError(ErrorCode::kCorrupt, "answer_corrupt", [&] {
      NativeReader reader({{"n", ParseNativeType(type)}});
      reader.Take(bytes);
      reader.Finish();
    });
  };
  const std::string most = "\xff\xff\xff\xff\xff\xff\xff\xff\xff";
  refuse("UInt64", "\x01" + most + "\x01");                   // rows
  refuse("UInt64", most + "\x01\x01");                        // columns
  refuse("UInt64", "\x01" + most + "\x7f");                   // more than 64 bits
  refuse("UInt64", std::string("\x01\x01") + most + "\x01");  // the length of a name
  refuse("String", "\x01\x01\x01n\x06String" + most + "\x01");
  refuse("Array(UInt8)",
         "\x01\x01\x01n\x0c"
         "Array(UInt8)" +
             std::string(8, '\xff'));
  refuse("UInt64", "\x01\x01\x01m\x06UInt64" + std::string(8, 'x'));  // another name
  refuse("UInt64", "\x01\x01\x01n\x05Int64" + std::string(8, 'x'));   // another type
  refuse("UInt64", "Code: 60, e.displayText() = DB::Exception: no such table");
  EXPECT_EQ(Read({{"n", ParseNativeType("UInt64")}}, "", 1).size(), 0u);
}

TEST(ClickhouseNative, ColumnsThatDoNotFitAreNotWritten) {
  NativeBlock block = EveryType();
  block.rows = 3;
  ExpectError(ErrorCode::kInvalidArgument, "native_block_invalid", [&] { EncodeNative(block); });
  for (const char* name : {"UInt16", "Nullable(UInt8)", "FixedString(0)", "Array(", ""}) {
    ExpectError(ErrorCode::kInvalidArgument, "native_type_unknown", [&] { ParseNativeType(name); });
  }
}

}  // namespace
}  // namespace pliant::clickhouse
