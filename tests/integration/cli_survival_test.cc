// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Indexing that is killed, interrupted, run twice at once, or out of space.
#include <chrono>
#include <thread>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/program.h"

namespace pliant::testing {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;
using Json = nlohmann::json;
using std::chrono::milliseconds;

constexpr std::uint64_t kSeed = 20240607;

class SurvivalTest : public ::testing::Test {
 protected:
  void WriteImages(const std::string& name, std::uint64_t first, int count) {
    for (int i = 0; i < count; ++i) {
      WriteBytes(folder_ / name / (std::to_string(i) + ".png"),
                 RandomPng(first + static_cast<std::uint64_t>(i)));
    }
  }
  std::vector<std::string> IndexArguments(const std::string& name) const {
    return {
        "index", (folder_ / name).string(), "--db", db_,     "--descriptor", "rootsift", "--jobs",
        "2",     "--object-from",           "stem", "--json"};
  }
  // Images that are committed, whoever writes; 0 while there is no database.
  std::int64_t Committed() const {
    if (!std::filesystem::exists(db_)) return 0;
    SQLite::Database db(db_, SQLite::OPEN_READWRITE, 5000);
    return db.execAndGet("SELECT count(*) FROM images").getInt64();
  }
  void ExpectSound() {
    const ProgramResult check = RunProgram({"db", "check", "--db", db_, "--json"});
    EXPECT_EQ(check.status, 0) << check.out << check.err;
  }
  std::size_t StrayFiles() {
    std::size_t stray = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      const std::string name = entry.path().filename().string();
      const bool is_stray =
          name.find(".new-") != std::string::npos || name.find(".part-") != std::string::npos;
      stray += is_stray ? 1 : 0;
    }
    return stray;
  }

  TemporaryFolder folder_;
  std::string db_ = (folder_ / "x.db").string();
};

TEST_F(SurvivalTest, KilledAtAnyMomentNothingCommittedIsLost) {
  constexpr int kImages = 60;
  WriteImages("p", 100, kImages);
  std::mt19937_64 random(kSeed);
  std::int64_t before = 0;
  bool killed_midway = false;
  for (int round = 0; round < 12; ++round) {
    SCOPED_TRACE("seed " + std::to_string(kSeed) + ", round " + std::to_string(round));
    Program program(IndexArguments("p"));
    std::this_thread::sleep_for(milliseconds(random() % static_cast<unsigned>(40 + 40 * round)));
    const bool ran = program.IsRunning();
    program.Signal(SIGKILL);
    program.Wait();
    const std::int64_t now = Committed();
    EXPECT_GE(now, before);
    killed_midway = killed_midway || (ran && now > before && now < kImages);
    before = now;
    if (std::filesystem::exists(db_)) ExpectSound();
  }
  const ProgramResult resumed = RunProgram(IndexArguments("p"));
  ASSERT_EQ(resumed.status, 0) << resumed.err;
  EXPECT_EQ(resumed.json()["unchanged"], before);
  EXPECT_EQ(resumed.json()["indexed"], kImages - before);
  EXPECT_FALSE(resumed.json()["vocabulary"].is_null());
  ExpectSound();
  RecordProperty("killed_midway", killed_midway ? 1 : 0);
}

TEST_F(SurvivalTest, KilledAtAnyMomentEveryImageHasItsOriginalsFile) {
  constexpr int kImages = 40;
  WriteImages("p", 1000, kImages);
  const std::filesystem::path originals = folder_ / "originals";
  std::vector<std::string> arguments = IndexArguments("p");
  arguments.insert(arguments.end(), {"--originals-dir", originals.string()});
  const auto files = [&] {
    std::int64_t count = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(originals)) {
      count += entry.is_regular_file() ? 1 : 0;
    }
    return count;
  };
  std::mt19937_64 random(kSeed);
  for (int round = 0; round < 12; ++round) {
    SCOPED_TRACE("seed " + std::to_string(kSeed) + ", round " + std::to_string(round));
    Program program(arguments);
    std::this_thread::sleep_for(milliseconds(random() % static_cast<unsigned>(40 + 40 * round)));
    program.Signal(SIGKILL);
    program.Wait();
    if (!std::filesystem::exists(db_)) continue;
    ExpectSound();                            // every image's file is there, with its hash
    if (round % 4 == 3 && Committed() > 0) {  // and removing goes on where it was cut off
      Program remover({"db", "rm", "--db", db_, "--object", "0", "--object", "1"});
      std::this_thread::sleep_for(milliseconds(random() % 30));
      remover.Signal(SIGKILL);
      remover.Wait();
      ExpectSound();
    }
  }
  const ProgramResult resumed = RunProgram(arguments);
  ASSERT_EQ(resumed.status, 0) << resumed.err;
  // What a process left that was killed while it wrote the owner's name goes after a minute.
  for (const auto& entry : std::filesystem::directory_iterator(originals)) {
    if (!entry.path().filename().string().starts_with("pliant-originals.part-")) continue;
    std::filesystem::last_write_time(
        entry.path(), std::filesystem::file_time_type::clock::now() - std::chrono::minutes(2));
  }
  const ProgramResult swept = RunProgram({"db", "check", "--sweep", "--db", db_, "--json"});
  EXPECT_EQ(swept.status, 0) << swept.out;
  EXPECT_EQ(Committed(), kImages);
  EXPECT_EQ(files(), kImages + 1) << "the images and the owner's name";
  const Json stats = RunProgram({"db", "stats", "--db", db_, "--json"}).json();
  EXPECT_EQ(stats["originals"]["files"], kImages);
  EXPECT_EQ(stats["originals"]["owned"], true);
}

TEST_F(SurvivalTest, CtrlCKeepsWhatWasIndexedAndSaysHowToResume) {
  for (const int signal : {SIGINT, SIGTERM}) {
    db_ = (folder_ / ("s" + std::to_string(signal) + ".db")).string();
    WriteImages("p", 300, 80);
    Program program(IndexArguments("p"));
    for (int i = 0; i < 2000 && Committed() < 3; ++i) std::this_thread::sleep_for(milliseconds(5));
    program.Signal(signal);
    const ProgramResult result = program.Wait();
    EXPECT_EQ(result.status, 128 + signal) << "as shells say it";
    EXPECT_THAT(result.err, HasSubstr("resume"));
    const Json json = result.json();
    EXPECT_EQ(json["interrupted"], true);
    EXPECT_EQ(json["indexed"], Committed());
    EXPECT_LT(json["indexed"], 80);
    const Json resumed = RunProgram(IndexArguments("p")).json();
    EXPECT_EQ(resumed["unchanged"], json["indexed"]);
    EXPECT_EQ(resumed["indexed"], 80 - json["indexed"].get<int>());
    ExpectSound();
  }
}

TEST_F(SurvivalTest, TwoProcessesAtOnceOnANewDatabase) {
  WriteImages("a", 500, 25);
  WriteImages("b", 600, 25);
  Program first(IndexArguments("a"));
  Program second(IndexArguments("b"));
  const ProgramResult a = first.Wait();
  const ProgramResult b = second.Wait();
  EXPECT_EQ(a.status, 0) << a.err;
  EXPECT_EQ(b.status, 0) << b.err;
  EXPECT_EQ(a.json()["indexed"], 25);
  EXPECT_EQ(b.json()["indexed"], 25);
  EXPECT_EQ(Committed(), 50);
  EXPECT_EQ(StrayFiles(), 0u);
  ExpectSound();
  WriteBytes(folder_ / "q.png", OtherViewPng(603));
  const Json found =
      RunProgram({"query", (folder_ / "q.png").string(), "--db", db_, "--json"}).json();
  EXPECT_EQ(found["hits"][0]["object"], "3");
  EXPECT_EQ(found["total"], 25) << "0.png to 24.png name the same objects in both folders";
}

TEST_F(SurvivalTest, QueriesGoOnBesideAWriter) {
  WriteImages("a", 500, 5);
  ASSERT_EQ(RunProgram(IndexArguments("a")).status, 0);
  SQLite::Database writer(db_, SQLite::OPEN_READWRITE);
  writer.exec("BEGIN IMMEDIATE");
  WriteBytes(folder_ / "q.png", OtherViewPng(502));
  const ProgramResult found =
      RunProgram({"query", (folder_ / "q.png").string(), "--db", db_, "--json"});
  EXPECT_EQ(found.status, 0) << found.err;
  EXPECT_EQ(found.json()["hits"][0]["object"], "2");
  writer.exec("ROLLBACK");
}

TEST_F(SurvivalTest, AFullDiskIsSaidAndHealed) {
  WriteImages("p", 700, 30);
  ProgramLimits limits;
  for (const std::uint64_t kib : {20, 100, 400, 1500}) {
    limits.max_file_bytes = kib * 1024;
    const ProgramResult full = RunProgram(IndexArguments("p"), limits);
    EXPECT_EQ(full.status, 1) << kib << " KiB: " << full.out;
    EXPECT_THAT(full.json()["error"]["code"].get<std::string>(), AnyOf("write_failed", "disk_full"))
        << full.err;
    EXPECT_EQ(StrayFiles(), 0u);
    if (std::filesystem::exists(db_)) ExpectSound();
  }
  const ProgramResult healed = RunProgram(IndexArguments("p"));
  EXPECT_EQ(healed.status, 0) << healed.err;
  EXPECT_EQ(Committed(), 30);
  ExpectSound();
}

TEST_F(SurvivalTest, AReadOnlyDatabaseAnswersAndRefuses) {
  WriteImages("p", 800, 5);
  ASSERT_EQ(RunProgram(IndexArguments("p")).status, 0);
  WriteImages("more", 900, 1);
  WriteBytes(folder_ / "q.png", OtherViewPng(803));
  namespace fs = std::filesystem;
  const auto protect = [&](fs::perms folder) {
    fs::permissions(db_, fs::perms(0444));
    fs::permissions(folder_.path(), folder);
  };
  protect(fs::perms(0555));
  const ProgramLimits limits{.unprivileged = true};
  const ProgramResult found =
      RunProgram({"query", (folder_ / "q.png").string(), "--db", db_, "--json"}, limits);
  EXPECT_EQ(found.status, 0) << found.err;
  EXPECT_EQ(found.json()["hits"][0]["object"], "3");
  const ProgramResult refused = RunProgram(IndexArguments("more"), limits);
  EXPECT_EQ(refused.status, 1) << refused.out;
  EXPECT_EQ(refused.json()["error"]["code"], "read_only") << refused.err;
  fs::permissions(folder_.path(), fs::perms(0755));
}

// A disc, or a share that is mounted for reading: even root cannot write there.
TEST_F(SurvivalTest, ReadOnlyMediaAreAnsweredFromAndNamed) {
  WriteImages("p", 800, 1);
  ASSERT_EQ(RunProgram(IndexArguments("p")).status, 0);
  const auto run = [&](const std::string& command) {
    const std::string script =
        "mount --bind $0 $0 && mount -o remount,ro,bind $0 && echo mounted && " +
        PliantPath().string() + " " + command + " --db $0/x.db";
    return Program({"-rm", "sh", "-c", script, folder_.path().string()}, {}, "/usr/bin/unshare")
        .Wait();
  };
  const ProgramResult stats = run("db stats");
  if (stats.out.empty()) GTEST_SKIP() << "no mounts here: " << stats.err;
  EXPECT_THAT(stats.out, HasSubstr("1 images, 1 objects")) << stats.err;
  for (const std::string command : {"vocab train", "db rm 1"}) {
    const ProgramResult refused = run(command);
    EXPECT_EQ(refused.status, 1) << command;
    EXPECT_THAT(refused.err,
                HasSubstr("x.db cannot be written; check its permissions and file system"));
  }
}

TEST_F(SurvivalTest, WithTooFewOpenFilesItSaysSo) {
  WriteImages("p", 2000, 8);
  int refused = 0;
  bool done = false;
  for (std::uint64_t files = 4; files <= 60 && !done; ++files) {
    const ProgramResult result = RunProgram(IndexArguments("p"), {.max_open_files = files});
    if (result.err.find("error while loading shared libraries") != std::string::npos) {
      continue;  // so many are open already that the program cannot even be loaded
    }
    done = result.status == 0;
    if (done) break;
    ASSERT_EQ(result.status, 1) << files << " files: " << result.out << result.err;
    ++refused;
    EXPECT_EQ(result.json()["error"]["code"], "too_many_open_files") << files << result.out;
    EXPECT_THAT(result.err, HasSubstr("ulimit -n")) << files;
  }
  EXPECT_TRUE(done);
  EXPECT_GT(refused, 2);
  EXPECT_EQ(Committed(), 8);
  ExpectSound();
  EXPECT_EQ(StrayFiles(), 0U);
}

}  // namespace
}  // namespace pliant::testing
