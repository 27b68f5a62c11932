// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Backups put in place of databases, by `pliant db restore` and by hand.
#include <fstream>

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include "tests/integration/cli_fixture.h"
#include "tests/integration/server_process.h"

namespace pliant::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class RestoreTest : public CliTest {
 protected:
  // A database of `count` images, and its backup.
  void MakeBackup(int count) {
    WriteObjects(count);
    ASSERT_EQ(Index().status, 0);
    ASSERT_EQ(RunProgram({"db", "backup", backup_, "--db", db_}).status, 0);
  }
  ProgramResult Restore(std::vector<std::string> more = {}) {
    std::vector<std::string> arguments = {"db", "restore", backup_, "--db", db_, "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunProgram(arguments);
  }
  static int Images(const std::string& database) {
    const ProgramResult stats = RunProgram({"db", "stats", "--db", database, "--json"});
    return stats.status == 0 ? stats.json()["images"].get<int>() : -1;
  }
  static void ExpectSound(const std::string& database) {
    const ProgramResult check = RunProgram({"db", "check", "--db", database});
    EXPECT_EQ(check.out, "ok\n") << check.err;
  }
  std::string Code(const ProgramResult& result) {
    return result.status == 0 ? "" : result.json()["error"]["code"].get<std::string>();
  }
  // The database, and what lies beside it but SQLite's own files.
  std::size_t Files() {
    std::size_t count = 0;
    for (const auto& entry : fs::directory_iterator(folder_.path())) {
      const std::string name = entry.path().filename().string();
      count += name.starts_with("x.db") && name != "x.db-wal" && name != "x.db-shm" ? 1 : 0;
    }
    return count;
  }

  std::string backup_ = (folder_ / "backup.db").string();
};

TEST_F(RestoreTest, TakesThePlaceOfADatabaseAndKeepsThatOne) {
  MakeBackup(3);
  WriteObjects(5);
  ASSERT_EQ(Index().status, 0);
  ASSERT_EQ(::chmod(db_.c_str(), 0640), 0);
  const ProgramResult refused = Restore();
  EXPECT_EQ(Code(refused), "database_exists");
  EXPECT_THAT(refused.err, HasSubstr("--replace"));
  EXPECT_EQ(Images(db_), 5);
  const ProgramResult restored = Restore({"--replace"});
  ASSERT_EQ(restored.status, 0) << restored.err;
  EXPECT_EQ(restored.json()["images"], 3);
  EXPECT_EQ(Images(db_), 3);
  ExpectSound(db_);
  struct stat info = {};
  ASSERT_EQ(::stat(db_.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0640U) << "who could read the old one can read this one";
  const std::string before = restored.json()["before"];
  EXPECT_EQ(Images(before), 5);
  ExpectSound(before);
  EXPECT_EQ(Images(backup_), 3) << "the backup stays";
}

TEST_F(RestoreTest, ALinkStaysALink) {
  MakeBackup(2);
  const std::string link = db_;
  db_ = (folder_ / "x.db.real").string();
  fs::rename(link, db_);
  fs::create_symlink(db_, link);
  ASSERT_EQ(RunProgram({"db", "restore", backup_, "--db", link, "--replace", "--json"}).status, 0);
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_FALSE(fs::is_symlink(db_));
  EXPECT_EQ(Images(link), 2);
}

TEST_F(RestoreTest, NeitherTheDatabaseNorTheBackupHasALogAfterwards) {
  MakeBackup(2);
  const auto expect_no_log = [&] {
    for (const std::string& file : {db_, backup_}) {
      EXPECT_FALSE(fs::exists(file + "-wal")) << file;
      EXPECT_FALSE(fs::exists(file + "-shm")) << file;
    }
  };
  for (const bool there :
       {true, false}) {  // a damaged log, and an index of it, that are not its own
    if (!there) fs::remove(db_);
    WriteText(db_ + "-wal", "of another database");
    WriteText(db_ + "-shm", "of another database");
    const ProgramResult restored = Restore({"--replace"});
    ASSERT_EQ(restored.status, 0) << restored.err;
    expect_no_log();
    fs::remove(restored.json()["before"].get<std::string>() + "-wal");
  }
  EXPECT_EQ(Images(db_), 2);
  ExpectSound(db_);
}

TEST_F(RestoreTest, ABackupWithALogIsReadWithIt) {
  MakeBackup(2);
  backup_ = (folder_ / "crashed.db").string();  // a copy of a database in use: some is in the log
  {
    SQLite::Database open(db_, SQLite::OPEN_READONLY);
    EXPECT_EQ(open.execAndGet("SELECT count(*) FROM images").getInt(), 2);
    WriteObjects(4);
    ASSERT_EQ(Index().status, 0);
    ASSERT_GT(fs::file_size(db_ + "-wal"), 0U);
    fs::copy_file(db_, backup_);
    fs::copy_file(db_ + "-wal", backup_ + "-wal");
  }
  const ProgramResult restored = Restore({"--replace"});
  ASSERT_EQ(restored.status, 0) << restored.err;
  EXPECT_EQ(restored.json()["images"], 4);
  EXPECT_EQ(Images(db_), 4);
}

TEST_F(RestoreTest, MakesADatabaseWhereNoneIs) {
  MakeBackup(2);
  fs::remove(db_);
  std::ofstream(db_ + "-wal") << "of a database that is gone";
  std::ofstream(db_ + "-shm") << "of it, too";
  const ProgramResult restored = Restore();
  ASSERT_EQ(restored.status, 0) << restored.err;
  EXPECT_EQ(Images(db_), 2);
  ExpectSound(db_);
  EXPECT_TRUE(fs::exists(restored.json()["before"].get<std::string>() + "-wal"));
}

TEST_F(RestoreTest, WhatCannotBeRestoredChangesNothing) {
  MakeBackup(3);
  const std::string good = backup_;
  EXPECT_EQ(Code(RunProgram({"db", "restore", db_, "--db", db_, "--replace", "--json"})),
            "same_file");
  backup_ = (folder_ / "none.db").string();
  EXPECT_EQ(Code(Restore({"--replace"})), "backup_not_found");
  WriteText(backup_,
            "no database at all, but long enough to have the header of one: "
            "0123456789012345678901234567890123456789012345678901234567890");
  EXPECT_EQ(Code(Restore({"--replace"})), "not_a_database");
  std::vector<std::uint8_t> bytes = ReadBytes(good);
  const std::string magic = "PLFT";  // some image's features
  const auto at = std::search(bytes.begin(), bytes.end(), magic.begin(), magic.end());
  ASSERT_NE(at, bytes.end());
  at[40] ^= 1;
  WriteBytes(backup_, bytes);
  const std::size_t files = Files();
  ASSERT_EQ(files, 1U);
  const ProgramResult damaged = Restore({"--replace"});
  EXPECT_EQ(Code(damaged), "backup_damaged");
  EXPECT_THAT(damaged.err, HasSubstr("checksum"));
  EXPECT_EQ(Files(), files) << "nothing is left over";
  EXPECT_EQ(Images(db_), 3);
  backup_ = good;
  EXPECT_EQ(Code(RunProgram(
                {"db", "restore", good, "--db", (folder_ / "no" / "x.db").string(), "--json"})),
            "no_such_directory");
  ProgramLimits small;
  small.max_file_bytes = fs::file_size(good) / 2;
  const ProgramResult full =
      Program({"db", "restore", good, "--db", db_, "--replace", "--json"}, small).Wait();
  EXPECT_EQ(full.status, 1);
  EXPECT_EQ(Code(full), "write_failed");
  EXPECT_THAT(full.err, HasSubstr("writing the database " + db_)) << "not what was only read";
  EXPECT_EQ(Files(), files);
  EXPECT_EQ(Images(db_), 3);
  ExpectSound(db_);
  const std::string target = folder_ / "full.db";
  const ProgramResult copied =
      Program({"db", "backup", target, "--db", db_, "--json"}, small).Wait();
  EXPECT_EQ(Code(copied), "write_failed");
  EXPECT_THAT(copied.err, HasSubstr("writing the database " + target)) << "not what was only read";
  EXPECT_FALSE(fs::exists(target));
}

TEST_F(RestoreTest, NotUnderARunningServer) {
  MakeBackup(2);
  ServerProcess server(db_);
  EXPECT_EQ(Code(Restore({"--replace"})), "database_in_use");
  const auto added =
      server.Client().Post("/v1/collections/default/images", TestImage(7), "image/png");
  ASSERT_TRUE(added);
  EXPECT_EQ(added->status, 201);
  EXPECT_EQ(server.Stop(), 0);
  EXPECT_EQ(Images(db_), 3) << "what was added is there";
  EXPECT_EQ(Restore({"--replace"}).status, 0);
  EXPECT_EQ(Images(db_), 2);
}

TEST_F(RestoreTest, ADatabaseThatIsCutShortIsReplaced) {
  MakeBackup(4);
  fs::resize_file(db_, fs::file_size(db_) / 2);
  EXPECT_EQ(Images(db_), -1);
  const ProgramResult restored = Restore({"--replace"});
  ASSERT_EQ(restored.status, 0) << restored.err;
  EXPECT_EQ(Images(db_), 4);
  ExpectSound(db_);
}

// By hand: the copy lies beside the log of the database that was there, which SQLite takes for its.
TEST_F(RestoreTest, AServerDoesNotStartOnADamagedDatabaseAndWritesNothing) {
  MakeBackup(3);
  {
    ServerProcess server(db_, {"--auto-train=false"});
    auto client = server.Client();
    for (std::uint64_t seed = 100; seed < 130; ++seed) {
      client.Post("/v1/collections/default/images", TestImage(seed), "image/png");
    }
    SQLite::Database(db_, SQLite::OPEN_READWRITE).exec("PRAGMA wal_checkpoint(TRUNCATE)");
    client.Delete("/v1/collections/default/objects/o1");
    client.Post("/v1/collections/default/images", TestImage(7), "image/png");
    server.Signal(SIGKILL);
    server.Wait();
  }
  ASSERT_GT(fs::file_size(db_ + "-wal"), 0U);
  fs::copy_file(backup_, db_, fs::copy_options::overwrite_existing);
  const std::vector<std::uint8_t> copy = ReadBytes(db_);
  const std::vector<std::uint8_t> log = ReadBytes(db_ + "-wal");
  const std::vector<std::string> start = {"--db", db_, "--listen", "127.0.0.1:0"};
  const ProgramResult refused = Program(start, {}, ServerPath()).Wait();
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr("is damaged"));
  EXPECT_THAT(refused.err, HasSubstr("pliant db restore"));
  EXPECT_EQ(ReadBytes(db_), copy);
  EXPECT_EQ(ReadBytes(db_ + "-wal"), log);
  const ProgramResult restored = Restore({"--replace"});
  ASSERT_EQ(restored.status, 0) << restored.err;
  EXPECT_EQ(Images(db_), 3);
  ExpectSound(db_);
  EXPECT_EQ(ServerProcess(db_).Stop(), 0);
}

}  // namespace
}  // namespace pliant::testing
