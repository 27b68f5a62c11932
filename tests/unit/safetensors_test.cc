// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The safetensors codec: what is written is read, sound files are read, everything else is refused
// by name.
#include "descriptor/base/safetensors.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "descriptor/base/replace_file.h"

namespace pliant {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::vector<std::uint8_t> FileOf(const std::string& header, const std::vector<std::uint8_t>& data) {
  const std::uint64_t length = header.size();
  std::vector<std::uint8_t> bytes(sizeof(length) + header.size() + data.size());
  std::memcpy(bytes.data(), &length, sizeof(length));
  std::copy(header.begin(), header.end(), bytes.begin() + sizeof(length));
  std::copy(data.begin(), data.end(), bytes.end() - static_cast<long>(data.size()));
  return bytes;
}

// Two tensors: a of 2 x 3 floats, b of 2 floats; 32 bytes of data.
const char* const kSound = R"({"__metadata__": {"format": "x"},
  "a": {"dtype": "F32", "shape": [2, 3], "data_offsets": [0, 24]},
  "b": {"dtype": "F32", "shape": [2], "data_offsets": [24, 32]}})";

std::string Fault(const std::function<void()>& act) {
  try {
    act();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt) << error.what();
    EXPECT_EQ(error.reason(), "tensor_file_corrupt");
    return error.what();
  }
  return "(nothing thrown)";
}

std::string ParseFault(const std::string& header, std::size_t data_bytes = 32) {
  return Fault([&] {
    SafetensorsFile::Parse(FileOf(header, std::vector<std::uint8_t>(data_bytes)), "w.safetensors");
  });
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(SafetensorsTest, ReadsHalfPrecision) {
  // 1, -2, the largest, the smallest above 0; then infinity.
  std::vector<std::uint8_t> data = {0x00, 0x3c, 0x00, 0xc0, 0xff, 0x7b, 0x01, 0x00, 0x00, 0x7c};
  const SafetensorsFile file = SafetensorsFile::Parse(
      FileOf(R"({"h": {"dtype": "F16", "shape": [2, 2], "data_offsets": [0, 8]},
                 "i": {"dtype": "F16", "shape": [1], "data_offsets": [8, 10]}})",
             data),
      "w");
  EXPECT_EQ(file.Floats("h"), (std::vector<float>{1, -2, 65504, 0x1p-24F}));
  EXPECT_THAT(Fault([&] { file.Floats("i"); }), HasSubstr("holds NaN or infinity"));
}

TEST(SafetensorsTest, ReadsSoundFile) {
  std::vector<std::uint8_t> data(32);
  const float values[] = {1, 2, 3, 4, 5, 6, 7, 8};
  std::memcpy(data.data(), values, 32);
  const SafetensorsFile file = SafetensorsFile::Parse(FileOf(kSound, data), "w");
  EXPECT_EQ(file.Floats("a"), (std::vector<float>{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(file.Floats("b"), (std::vector<float>{7, 8}));
  EXPECT_EQ(file.tensors().at("a").shape, (std::vector<std::int64_t>{2, 3}));
  EXPECT_EQ(file.metadata().at("format"), "x");
}

TEST(SafetensorsTest, RefusesMalformedHeadersByName) {
  struct Case {
    const char* from;
    const char* to;
    const char* expected;
  };
  const Case cases[] = {
      {"[24, 32]", "[24, 36]", "'b' ends at byte 36 of 32"},
      {"[24, 32]", "[20, 28]", "'b' overlaps"},
      {"[24, 32]", "[28, 32]", "'b' holds 4 bytes, but its shape [2] needs 8"},
      {"[24, 32]", "[32, 24]", "'b' has data_offsets"},
      {"[24, 32]", "[-8, 0]", "'b' has data_offsets"},
      {"[24, 32]", "[24.0, 32]", "'b' has data_offsets"},
      {"[24, 32]", "[24, 18446744073709551615]", "'b' has data_offsets"},
      {"[24, 32]", "24", "'b' has data_offsets"},
      {"[2, 3]", "[2, -3]", "'a' has an extent"},
      {"[2, 3]", "[4294967296, 4294967296]", "'a' has a shape larger"},
      {"[2, 3]", "[0, 9223372036854775807, 4]", "'a' holds 24 bytes"},
      {"[2, 3]", "\"6\"", "'a' has a shape that is not"},
      {"\"F32\"", "\"F33\"", "'a' has the unknown dtype 'F33'"},
      {"\"F32\"", "7", "'a' has a dtype"},
      {"\"shape\": [2, 3], ", "", "'a' needs dtype, shape"},
      {"\"b\"", "\"a\"", "'a' is described twice"},
      {"\"x\"", "1", "__metadata__ 'format'"},
      {"{\"format\": \"x\"}", "[]", "__metadata__ is not"},
  };
  for (const Case& c : cases) {
    const std::string fault = ParseFault(Replaced(kSound, c.from, c.to));
    EXPECT_THAT(fault, HasSubstr(c.expected)) << c.from << " -> " << c.to;
    EXPECT_THAT(fault, HasSubstr("w.safetensors"));
  }
  EXPECT_THAT(ParseFault("[]"), HasSubstr("not a JSON object"));
  EXPECT_THAT(ParseFault("{"), HasSubstr("not a JSON object"));
  EXPECT_THAT(ParseFault(kSound, 33), HasSubstr("1 bytes after the last tensor"));
  EXPECT_THAT(ParseFault(std::string(100000, '[')), HasSubstr("not a JSON object"));
}

TEST(SafetensorsTest, RefusesEveryTruncation) {
  const std::vector<std::uint8_t> whole = FileOf(kSound, std::vector<std::uint8_t>(32));
  for (std::size_t size = 0; size < whole.size(); ++size) {
    const std::vector<std::uint8_t> part(whole.begin(), whole.begin() + static_cast<long>(size));
    EXPECT_NE(Fault([&] { SafetensorsFile::Parse(part, "w"); }), "(nothing thrown)") << size;
  }
}

TEST(SafetensorsTest, RefusesHugeHeaderLengthAndMissingFile) {
  std::vector<std::uint8_t> bytes(100, 0xff);
  EXPECT_THAT(Fault([&] { SafetensorsFile::Parse(bytes, "w"); }), HasSubstr("exceeds the file"));
  try {
    SafetensorsFile::Open("/nonexistent/w.safetensors");
    FAIL() << "opened a file that does not exist";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kNotFound);
    EXPECT_THAT(error.what(), HasSubstr("/nonexistent/w.safetensors"));
  }
}

TEST(SafetensorsTest, RandomDamageIsRefusedOrReadWithinTheFile) {
  constexpr std::uint32_t kSeed = 20211206;
  std::mt19937 random(kSeed);
  const std::vector<std::uint8_t> whole = FileOf(kSound, std::vector<std::uint8_t>(32));
  int refused = 0;
  for (int round = 0; round < 3000; ++round) {
    std::vector<std::uint8_t> bytes = whole;
    for (std::uint32_t n = random() % 4 + 1; n > 0; --n) {
      bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
    }
    if (random() % 8 == 0) bytes.resize(random() % bytes.size());
    try {
      const SafetensorsFile file = SafetensorsFile::Parse(bytes, "w");
      for (const auto& [name, info] : file.tensors()) {
        if (info.dtype == "F32") {
          EXPECT_LE(file.Floats(name).size(), 8U) << "seed " << kSeed;
        }
      }
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt) << "seed " << kSeed << ": " << error.what();
      ++refused;
    }
  }
  EXPECT_GT(refused, 1000) << "seed " << kSeed;
}

class SafetensorsFiles : public ::testing::Test {
 protected:
  SafetensorsFiles()
      : folder_(fs::temp_directory_path() / ("pliant_safetensors_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~SafetensorsFiles() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  static std::string Content(const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  static void Put(const fs::path& path, const std::string& content) {
    std::ofstream(path, std::ios::binary | std::ios::trunc)
        .write(content.data(), static_cast<std::streamsize>(content.size()));
  }
  std::size_t FilesThere() const {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  fs::path folder_;
};

TEST_F(SafetensorsFiles, NamesOfEveryKindSurvive) {
  const fs::path path = folder_ / "names.safetensors";
  const std::vector<std::string> names = {"a \"quoted\" name", "back\\slash", "café/1", "tab\there",
                                          "two\nlines"};
  std::vector<Tensor> tensors;
  for (std::uint8_t i = 0; i < names.size(); ++i) tensors.push_back({names[i], "U8", {1}, {i}});
  ASSERT_FALSE(WriteSafetensors(path, tensors, {{"a \"key\"\t", "v\n\x01"}}));
  const std::vector<Tensor> read = ReadSafetensors(path);
  ASSERT_EQ(read.size(), names.size());
  for (std::uint8_t i = 0; i < names.size(); ++i) {
    EXPECT_EQ(read[i].name, names[i]);  // they were in order
    EXPECT_EQ(read[i].bytes, std::vector<std::uint8_t>{i});
  }
  EXPECT_EQ(ReadSafetensorsHeader(path).metadata.at("a \"key\"\t"), "v\n\x01");
  EXPECT_EQ(SafetensorsFile::Open(path).tensors().size(), names.size());
}

TEST_F(SafetensorsFiles, EscapesOfOtherWritersAreRead) {
  const std::vector<std::uint8_t> file = FileOf(
      R"({"caf\u00e9\/\ud83d\ude00": {"dtype": "U8", "shape": [1], "data_offsets": [0, 1]}})", {7});
  const fs::path path = folder_ / "escapes.safetensors";
  Put(path, {file.begin(), file.end()});
  EXPECT_EQ(ReadSafetensors(path).at(0).name, "café/\U0001F600");
}

TEST_F(SafetensorsFiles, BytesThatAreNoTextAreReplaced) {
  const fs::path path = folder_ / "latin1.safetensors";
  ASSERT_FALSE(WriteSafetensors(path, {{"caf\xe9", "U8", {1}, {7}}}, {{"k", "\xff"}}));
  EXPECT_EQ(ReadSafetensors(path).at(0).name, "caf\uFFFD");
  EXPECT_EQ(ReadSafetensorsHeader(path).metadata.at("k"), "\uFFFD");
}

TEST_F(SafetensorsFiles, AllReadersRefuseDamage) {
  const fs::path path = folder_ / "pack.safetensors";
  ASSERT_FALSE(
      WriteSafetensors(path, {{"a", "F32", {2, 3}, std::vector<std::uint8_t>(24, 1)}}, {}));
  const std::string whole = Content(path);
  for (std::size_t length = 0; length < whole.size(); ++length) {
    Put(path, whole.substr(0, length));
    EXPECT_NE(Fault([&] { ReadSafetensors(path); }), "(nothing thrown)") << length;
    EXPECT_NE(Fault([&] { ReadSafetensorsHeader(path); }), "(nothing thrown)") << length;
    EXPECT_NE(Fault([&] { SafetensorsFile::Open(path); }), "(nothing thrown)") << length;
  }
  for (const fs::path& none : {folder_ / "none", folder_}) {
    EXPECT_THROW(ReadSafetensors(none), Error);
    EXPECT_THROW(ReadSafetensorsHeader(none), Error);
  }
}

TEST_F(SafetensorsFiles, AFileIsReplacedWholeOrNotAtAll) {
  const fs::path path = folder_ / "a";
  const std::vector<std::string_view> first = {"one ", "", "two"};
  EXPECT_FALSE(ReplaceFile(path, first));
  EXPECT_EQ(Content(path), "one two");
  const std::string_view second = "three";
  EXPECT_FALSE(ReplaceFile(path, {&second, 1}));
  EXPECT_EQ(Content(path), "three");
  fs::create_directories(folder_ / "folder" / "full");
  EXPECT_TRUE(ReplaceFile(folder_ / "folder", {&second, 1}));
  EXPECT_TRUE(ReplaceFile(folder_ / "nowhere" / "a", {&second, 1}));
  EXPECT_EQ(FilesThere(), 2U) << "a temporary file was left";
  if (fs::exists("/dev/full")) {
    fs::create_symlink("/dev/full", folder_ / ("b.part-" + std::to_string(::getpid())));
    EXPECT_EQ(ReplaceFile(folder_ / "b", {&second, 1}), std::errc::no_space_on_device);
    EXPECT_FALSE(fs::exists(folder_ / "b"));
  }
}

}  // namespace
}  // namespace pliant
