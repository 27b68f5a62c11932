// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Puts the databases of a program's tests on the PostgreSQL server that PLIANT_TEST_DATABASE names:
// for each file a schema of its own.
#include <cstdlib>
#include <map>
#include <string>

#include <gtest/gtest.h>
#include <libpq-fe.h>
#include <unistd.h>

#include "tests/unit/test_database.h"

namespace pliant::testing {
namespace {

class OnPostgres : public ::testing::Environment {
 public:
  void SetUp() override {
    const char* url = std::getenv("PLIANT_TEST_DATABASE");
    ASSERT_NE(url, nullptr) << "run this by tests/postgres/on_postgres.sh";
    connection_ = PQconnectdb(url);
    ASSERT_EQ(PQstatus(connection_), CONNECTION_OK) << PQerrorMessage(connection_);
    database_for_file = [this, url = std::string(url)](const std::filesystem::path& file) {
      std::string& own = made_[file];
      if (own.empty()) {
        const std::string schema =
            "test_" + std::to_string(::getpid()) + "_" + std::to_string(made_.size());
        PGresult* done = PQexec(connection_, ("CREATE SCHEMA " + schema).c_str());
        EXPECT_EQ(PQresultStatus(done), PGRES_COMMAND_OK) << PQerrorMessage(connection_);
        PQclear(done);
        own = url + "?options=-csearch_path%3D" + schema;
      }
      return std::filesystem::path(own);
    };
  }
  void TearDown() override {
    database_for_file = nullptr;
    PQfinish(connection_);
  }

 private:
  PGconn* connection_ = nullptr;
  std::map<std::filesystem::path, std::string> made_;
};

const auto* const environment = ::testing::AddGlobalTestEnvironment(new OnPostgres);

}  // namespace
}  // namespace pliant::testing
