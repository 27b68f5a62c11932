// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The simulated disk loses what it should and no more, and the campaign notices a loss.
#include "tests/chaos/faults/simulated_disk.h"

#include <cerrno>
#include <string>

#include <SQLiteCpp/SQLiteCpp.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include "tests/chaos/faults/campaign.h"
#include "tests/unit/index_test_images.h"

namespace pliant::chaos {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class SimulatedDiskTest : public ::testing::Test {
 protected:
  static void Write(int fd, const std::string& text, off_t at) {
    ASSERT_EQ(::pwrite(fd, text.data(), text.size(), at), static_cast<ssize_t>(text.size()));
  }
  int OpenNew(const std::string& name) {
    return ::open((folder_ / name).c_str(), O_RDWR | O_CREAT, 0666);
  }
  void FlushFolder() {
    const int fd = ::open(folder_.path().c_str(), O_RDONLY | O_DIRECTORY);
    EXPECT_EQ(::fsync(fd), 0);
    ::close(fd);
  }
  static std::string Text(const Image& image, const std::string& name) {
    const auto found = image.files.find(name);
    return found == image.files.end() ? "(none)"
                                      : std::string(found->second.begin(), found->second.end());
  }
  Image Left(Keep keep = Keep::kNothing) { return disk_.AfterPowerLoss(keep, 1); }

  testing::TemporaryFolder folder_;
  SimulatedDisk disk_{folder_.path()};
};

TEST_F(SimulatedDiskTest, KeepsBytesAndNamesThatWereFlushed) {
  const int fd = OpenNew("a");
  Write(fd, "one", 0);
  EXPECT_EQ(::fsync(fd), 0);
  EXPECT_EQ(Text(Left(), "a"), "(none)") << "its name is not durable";
  FlushFolder();
  EXPECT_EQ(Text(Left(), "a"), "one");
  Write(fd, "two", 3);
  EXPECT_EQ(Text(Left(), "a"), "one");
  EXPECT_EQ(Text(Left(Keep::kEverything), "a"), "onetwo");
  EXPECT_EQ(::ftruncate(fd, 1), 0);
  EXPECT_EQ(Text(Left(), "a"), "one");
  EXPECT_EQ(::fdatasync(fd), 0);
  EXPECT_EQ(Text(Left(), "a"), "o");
  ::close(fd);
}

TEST_F(SimulatedDiskTest, UndoesNamesThatWereNotFlushed) {
  ::close(OpenNew("a"));
  FlushFolder();
  EXPECT_EQ(::rename((folder_ / "a").c_str(), (folder_ / "b").c_str()), 0);
  EXPECT_EQ(Text(Left(), "a"), "");
  EXPECT_EQ(Text(Left(), "b"), "(none)");
  FlushFolder();
  EXPECT_EQ(Text(Left(), "a"), "(none)");
  EXPECT_EQ(Text(Left(), "b"), "");
  EXPECT_EQ(::unlink((folder_ / "b").c_str()), 0);
  EXPECT_EQ(Text(Left(), "b"), "");
  EXPECT_EQ(Text(Left(Keep::kEverything), "b"), "(none)");
}

TEST_F(SimulatedDiskTest, AFileInAFolderThatIsGoneIsGone) {
  const std::filesystem::path inner = folder_ / "inner";
  EXPECT_EQ(::mkdir(inner.c_str(), 0777), 0);
  ::close(OpenNew("inner/a"));
  const int fd = ::open(inner.c_str(), O_RDONLY | O_DIRECTORY);
  EXPECT_EQ(::fsync(fd), 0);
  ::close(fd);
  EXPECT_EQ(Text(Left(), "inner/a"), "(none)");
  FlushFolder();
  EXPECT_EQ(Text(Left(), "inner/a"), "");
}

TEST_F(SimulatedDiskTest, AFailedFlushLosesWhatItShouldHaveWritten) {
  const int fd = OpenNew("a");
  FlushFolder();
  Write(fd, "one", 0);
  disk_.Arm({Fault::Kind::kError, kFlushes, 1, false, EIO});
  EXPECT_EQ(::fsync(fd), -1);
  EXPECT_EQ(errno, EIO);
  EXPECT_EQ(::fsync(fd), 0);
  EXPECT_EQ(Text(Left(), "a"), "");
  ::close(fd);
}

TEST_F(SimulatedDiskTest, NothingHappensWithoutPower) {
  const int fd = OpenNew("a");
  FlushFolder();
  Write(fd, "one", 0);
  disk_.Arm({Fault::Kind::kPowerLoss, kWrites, 1, false, 0});
  EXPECT_EQ(::pwrite(fd, "two", 3, 3), -1);
  EXPECT_EQ(disk_.victim(), "write \"a\"");
  EXPECT_EQ(::fsync(fd), -1);
  EXPECT_EQ(Text(Left(), "a"), "");
  EXPECT_EQ(Text(Left(Keep::kEverything), "a"), "onetwo") << "the one that was cut may be done";
  ::close(fd);
}

// SQLite's own calls are seen: it keeps a transaction where it flushes, and only there.
TEST_F(SimulatedDiskTest, SeesWhetherSqliteFlushes) {
  for (const std::string mode : {"FULL", "OFF"}) {
    const std::string name = mode + ".db";
    {
      SQLite::Database db((folder_ / name).string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
      db.exec("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; CREATE TABLE t (x)");
    }
    SQLite::Database db((folder_ / name).string(), SQLite::OPEN_READWRITE);
    db.exec("PRAGMA synchronous = " + mode + "; INSERT INTO t VALUES ('kept')");
    const testing::TemporaryFolder after;
    WriteImage(Left(), after.path());
    SQLite::Database left((after / name).string(), SQLite::OPEN_READWRITE);
    EXPECT_EQ(left.execAndGet("SELECT count(*) FROM t").getInt(), mode == "FULL" ? 1 : 0) << mode;
  }
}

// No fault but flushes that do nothing: what was acknowledged is lost, and the campaign says so.
TEST(CampaignTest, NoticesMissingFlushes) {
  constexpr std::uint64_t kNever = 1'000'000;
  const auto problems = [](const std::string& scenario, bool files, bool directories) {
    Campaign campaign(ScenarioOf(scenario));
    campaign.IgnoreFlushes(files, directories);
    return campaign.LosePower(kNever, Keep::kNothing, 0).problems;
  };
  for (const std::string scenario : {"upload", "upload_files", "remove", "use_vocabulary"}) {
    EXPECT_THAT(problems(scenario, false, false), IsEmpty()) << scenario;
    EXPECT_THAT(problems(scenario, true, false), Not(IsEmpty())) << scenario;
  }
  EXPECT_THAT(problems("upload_files", false, true), Not(IsEmpty()));
  EXPECT_THAT(problems("backup", false, true), Not(IsEmpty()));
  EXPECT_THAT(problems("backup", true, false), Not(IsEmpty()));
}

TEST(CampaignTest, NamesTheCallThatWasStruck) {
  Campaign campaign(ScenarioOf("upload_files"));
  const Verdict verdict = campaign.Fail({Fault::Kind::kError, kAdds, 2, false, EIO});
  EXPECT_TRUE(verdict.struck);
  EXPECT_THAT(verdict.victim, HasSubstr("make or rename"));
  EXPECT_THAT(verdict.problems, IsEmpty());
}

}  // namespace
}  // namespace pliant::chaos
