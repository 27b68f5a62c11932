// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Archives of NumPy, read by Python's zipfile: NumPy itself reads them in tests/python.
#include <array>
#include <cstdio>
#include <fstream>
#include <memory>
#include <string>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include "descriptor/base/error.h"
#include "index/files/features_npz.h"
#include "index/files/read_npz.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_images.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;

// A file with holes where zeros are written.
class SparseFile {
 public:
  explicit SparseFile(const std::filesystem::path& path)
      : fd_(::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC, 0600)) {}
  ~SparseFile() { ::close(fd_); }
  NpzArchive::Write write() {
    return [this](std::uint64_t offset, std::string_view bytes) {
      end_ = std::max(end_, offset + bytes.size());
      if (bytes.find_first_not_of('\0') == std::string_view::npos) return;
      ASSERT_EQ(::pwrite(fd_, bytes.data(), bytes.size(), static_cast<off_t>(offset)),
                static_cast<ssize_t>(bytes.size()));
    };
  }
  void Close() { ASSERT_EQ(::ftruncate(fd_, static_cast<off_t>(end_)), 0); }
  std::uint64_t size() const { return end_; }

 private:
  const int fd_;
  std::uint64_t end_ = 0;
};

std::string Python(const std::string& program, const std::filesystem::path& file) {
  const std::string command = "python3 -c '" + program + "' " + file.string() + " 2>&1";
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(::popen(command.c_str(), "r"), ::pclose);
  std::string out;
  std::array<char, 4096> buffer{};
  while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe.get())) {
    out.append(buffer.data(), n);
  }
  return out;
}

constexpr const char* kList = R"(
import sys, zipfile
with zipfile.ZipFile(sys.argv[1]) as z:
    for i in z.infolist():
        content = z.read(i) if i.file_size < 1000 else b""   # checks the CRC
        print(i.filename, i.file_size, i.header_offset > 2**32, i.extract_version, content[128:].hex())
)";

TEST(NpzArchiveTest, HasItsArrays) {
  const TemporaryFolder folder;
  SparseFile file(folder / "a.npz");
  NpzArchive archive(file.write());
  const std::array<std::int64_t, 1> two = {2};
  const std::size_t numbers = archive.Declare("numbers", "<i8", two);
  const std::size_t text = archive.Declare("text", "<U3", {});
  archive.Append(numbers, std::string("\1\0\0\0\0\0\0\0", 8));
  archive.AppendText(text, "\xC3\xA9", 3);
  archive.Append(numbers, std::string(8, '\2'));
  archive.Finish();
  file.Close();
  EXPECT_EQ(file.size(), archive.bytes());
  EXPECT_EQ(Python(kList, folder / "a.npz"),
            "numbers.npy 144 False 45 01000000000000000202020202020202\n"
            "text.npy 140 False 45 e90000000000000000000000\n");
}

TEST(NpzArchiveTest, BeyondFourGib) {
  const TemporaryFolder folder;
  SparseFile file(folder / "a.npz");
  NpzArchive archive(file.write());
  constexpr std::int64_t kMiB = 1 << 20;
  constexpr std::int64_t kPieces = 4097;
  const std::array<std::int64_t, 2> much = {kPieces, kMiB};
  const std::size_t zeros = archive.Declare("zeros", "|u1", much);
  const std::size_t last = archive.Declare("last", "<i8", {});
  const std::string piece(kMiB, '\0');
  for (std::int64_t i = 0; i < kPieces; ++i) archive.Append(zeros, piece);
  archive.Append(last, std::string(8, '\7'));
  archive.Finish();
  file.Close();
  EXPECT_EQ(file.size(), archive.bytes());
  EXPECT_EQ(Python(kList, folder / "a.npz"),
            "zeros.npy " + std::to_string(kPieces * kMiB + 128) +
                " False 45 \nlast.npy 136 True 45 0707070707070707\n");
}

TEST(NpzArchiveTest, NoValuesAmongOthers) {
  const TemporaryFolder folder;
  SparseFile file(folder / "a.npz");
  NpzArchive archive(file.write());
  const std::array<std::int64_t, 1> eight = {8};
  const std::size_t array = archive.Declare("a", "|u1", eight);
  archive.Append(array, {});  // of an image without keypoints
  archive.Append(array, std::string(8, '\7'));
  archive.Append(array, {});
  archive.Finish();
  file.Close();
  EXPECT_EQ(Python(kList, folder / "a.npz"), "a.npy 136 False 45 0707070707070707\n");
}

TEST(NpzArchiveTest, AsManyValuesAsWereDeclared) {
  const auto nothing = [](std::uint64_t, std::string_view) {};
  const std::array<std::int64_t, 1> two = {2};
  NpzArchive few(nothing);
  few.Append(few.Declare("a", "<i8", two), std::string(8, '\0'));
  ExpectError(ErrorCode::kInternal, "archive_incomplete", [&] { few.Finish(); });
  NpzArchive many(nothing);
  const std::size_t array = many.Declare("a", "<i8", two);
  ExpectError(ErrorCode::kInternal, "archive_incomplete",
              [&] { many.Append(array, std::string(17, '\0')); });
}

TEST(NpzArchiveTest, FeaturesOfNoImage) {
  const TemporaryFolder folder;
  SparseFile file(folder / "a.npz");
  FeatureTotals totals;
  totals.dim = 128;
  totals.model_id = "m:1";
  totals.object_length = 1;
  FeaturesArchive archive(totals, file.write());
  archive.Finish();
  file.Close();
  EXPECT_EQ(file.size(), archive.bytes());
  EXPECT_EQ(Python("import sys, zipfile; print(zipfile.ZipFile(sys.argv[1]).testzip())",
                   folder / "a.npz"),
            "None\n");
  Features features;
  features.descriptors = Descriptors::Binary(0, 32);
  FeaturesArchive other(totals, [](std::uint64_t, std::string_view) {});
  ExpectError(ErrorCode::kInternal, "archive_incomplete", [&] { other.Add("a", "", features); });
}

// A file of two keypoints, and how it is read after a change.
class ReadNpzTest : public ::testing::Test {
 protected:
  static Features Written() {
    Features features;
    features.width = 64;
    features.height = 48;
    features.keypoints = {{1.5F, 2, 3, 4, 0.5F, 6}, {10, 20, 30, 40, 0.25F, -1}};
    features.descriptors = Descriptors::Float(2, 3);
    features.descriptors.floats = {1, 2, 3, 4, 5, 6};
    features.model_id = "other:1";
    return features;
  }
  Features Read(const std::string& file) {
    std::ofstream(path_, std::ios::binary) << file;
    return ReadFeaturesNpz(path_);
  }

  const TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_.path() / "a.npz";
};

TEST_F(ReadNpzTest, ReadsWhatIsWritten) {
  Features features = Written();
  Features read = Read(FeaturesNpz(features));
  EXPECT_EQ(read.keypoints, features.keypoints);
  EXPECT_EQ(read.descriptors.floats, features.descriptors.floats);
  EXPECT_EQ(read.descriptors.dim, 3);
  EXPECT_EQ(read.model_id, "other:1");
  EXPECT_EQ(read.width, 64);
  EXPECT_EQ(read.height, 48);
  features.descriptors = Descriptors::Binary(2, 1);
  features.descriptors.bytes = {7, 8};
  read = Read(FeaturesNpz(features));
  EXPECT_EQ(read.descriptors.kind, DescriptorKind::kBinary);
  EXPECT_EQ(read.descriptors.bytes, features.descriptors.bytes);
}

// The archive has no checksum over its directory: a change there can go unnoticed, but is never
// read beyond the file.
TEST_F(ReadNpzTest, RefusesDamage) {
  const std::string file = FeaturesNpz(Written());
  for (std::size_t length = 0; length < file.size(); ++length) {
    ExpectError(ErrorCode::kCorrupt, "features_unreadable", [&] { Read(file.substr(0, length)); });
  }
  int refused = 0;
  for (std::size_t i = 0; i < file.size(); ++i) {
    std::string damaged = file;
    damaged[i] = static_cast<char>(damaged[i] ^ (i % 2 == 0 ? '\x01' : '\xFF'));
    try {
      Read(damaged);
    } catch (const Error& error) {
      EXPECT_EQ(error.reason(), "features_unreadable") << i;
      ++refused;
    }
  }
  EXPECT_GT(refused, static_cast<int>(file.size()) / 2);
  ExpectError(ErrorCode::kNotFound, "cannot_read",
              [&] { ReadFeaturesNpz(folder_.path() / "none.npz"); });
}

}  // namespace
}  // namespace pliant::testing
