// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Which directories a server may be given.
#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "descriptor/base/error.h"
#include "server/app/options.h"
#include "tests/unit/index_test_images.h"

namespace pliant::server {
namespace {

namespace fs = std::filesystem;

std::string Refusal(const fs::path& database, const fs::path& backups) {
  ServerOptions options;
  options.service.engine.database = database;
  options.service.backup_dir = backups;
  try {
    CheckOptions(options);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ServerDirectories, BackupsLieApartFromTheDatabase) {
  const testing::TemporaryFolder folder;
  fs::create_directory(folder / "backups");
  fs::create_directory_symlink(folder.path(), folder / "backups" / "linked");
  for (const bool is_made : {false, true}) {
    if (is_made) std::ofstream(folder / "p.db") << "it";
    EXPECT_EQ(Refusal(folder / "p.db", folder / "backups"), "");
    for (const fs::path& same :
         {folder.path(), folder / "backups" / "..", folder / "backups" / "linked"}) {
      EXPECT_THAT(Refusal(folder / "p.db", same), ::testing::StartsWith("--backup-dir ")) << same;
      EXPECT_THAT(Refusal(folder / "p.db", same), ::testing::HasSubstr("contains the database"));
    }
  }
  fs::create_symlink(folder / "p.db", folder / "backups" / "other.db");
  EXPECT_NE(Refusal(folder / "backups" / "other.db", folder / "backups"), "") << "its name";
  EXPECT_NE(Refusal(folder / "backups" / "other.db", folder.path()), "") << "what it links to";
}

TEST(ServerDirectories, ADatabaseOnAServerHasNoFileThatCouldLieThere) {
  const testing::TemporaryFolder folder;
  EXPECT_EQ(Refusal("postgresql://127.0.0.1/p", folder.path()), "");
  EXPECT_EQ(Refusal("", folder.path()), "");
}

}  // namespace
}  // namespace pliant::server
