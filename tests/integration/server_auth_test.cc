// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// API keys: made, shown, refused, revoked while the server runs; and how often one may ask.
#include <fstream>
#include <sstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/server_process.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::Not;

constexpr const char* kImages = "/v1/collections/default/images";

class AuthTest : public ::testing::Test {
 protected:
  ProgramResult Keys(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "keys");
    arguments.insert(arguments.end(), {"--db", DatabaseOf(database())});
    return Program(arguments, {}, ServerPath()).Wait();
  }
  // The new key, one line.
  std::string Create(const std::string& scope, const std::string& name) {
    const ProgramResult made =
        Keys({"create", "--scope", scope, "--name", name, "--descriptor", "rootsift"});
    EXPECT_EQ(made.status, 0) << made.err;
    return made.out.substr(0, made.out.find('\n'));
  }
  std::filesystem::path database() const { return folder_.path() / "test.db"; }

  static httplib::Client With(const ServerProcess& server, const std::string& key) {
    auto client = server.Client();
    client.set_default_headers({{"Authorization", "Bearer " + key}});
    return client;
  }
  static std::string CodeOf(const httplib::Result& answer) {
    return Json::parse(answer->body).value("code", "");
  }

  TemporaryFolder folder_;
};

TEST_F(AuthTest, ScopesDoWhatTheySay) {
  const std::string read = Create("read", "page");
  const std::string write = Create("write", "shop");
  const std::string admin = Create("admin", "me");
  EXPECT_THAT(read, MatchesRegex("plk_[0-9a-f]{8}_[A-Za-z0-9_-]{43}"));
  ServerProcess server(database(), {"--auto-train", "false"});
  auto reader = With(server, read);
  auto writer = With(server, write);
  auto owner = With(server, admin);
  const std::string image = TestImage(1);
  EXPECT_EQ(reader.Get("/v1/collections")->status, 200);
  EXPECT_EQ(CodeOf(reader.Post(kImages, image, "image/png")), "forbidden");
  EXPECT_EQ(writer.Post(kImages, image, "image/png")->status, 201);
  const std::string some = std::string(kImages) + "?filter=%7B%22n%22%3A1%7D";
  EXPECT_EQ(CodeOf(reader.Delete(some)), "forbidden");
  EXPECT_EQ(writer.Delete(some)->status, 200);
  const std::string import = std::string(kImages) + ":import";
  EXPECT_EQ(CodeOf(reader.Post(import, "{}", "application/x-ndjson")), "forbidden");
  EXPECT_EQ(writer.Post(import, "{}", "application/x-ndjson")->status, 202);
  EXPECT_EQ(reader.Get("/v1/collections/default/export")->status, 200);
  EXPECT_EQ(reader.Get(std::string(kImages) + "?sort=-created&count=true")->status, 200);
  const httplib::MultipartFormDataItems both = {{"image", image, "a.png", "image/png"},
                                                {"image", image, "b.png", "image/png"}};
  EXPECT_EQ(reader.Post("/v1/compare", both)->status, 200);
  EXPECT_EQ(reader.Post("/v1/qr", Json{{"text", write}}.dump(), "application/json")->status, 200);
  EXPECT_EQ(writer.Get(kImages)->status, 200);
  EXPECT_EQ(CodeOf(writer.Put("/v1/collections/toys")), "forbidden");
  EXPECT_EQ(owner.Put("/v1/collections/toys")->status, 201);

  auto stranger = server.Client();
  EXPECT_EQ(stranger.Get("/livez")->status, 200);
  EXPECT_EQ(CodeOf(stranger.Get("/v1/collections")), "unauthorized");
  EXPECT_EQ(CodeOf(stranger.Post("/v1/qr", R"({"text": "x"})", "application/json")),
            "unauthorized");
  EXPECT_EQ(stranger.Get("/v1/collections", {{"X-API-Key", read}})->status, 200);
  std::string wrong = read;
  wrong.back() = wrong.back() == 'A' ? 'B' : 'A';
  for (const std::string& shown :
       {"Bearer " + wrong, std::string("Bearer "), std::string("Basic abc"), "bearer" + read,
        std::string("Bearer plk_00000000_x"), "Bearer " + read + "x"}) {
    const auto answer = stranger.Get("/v1/collections", {{"Authorization", shown}});
    EXPECT_EQ(answer->status, 401) << shown;
    EXPECT_EQ(CodeOf(answer), "unauthorized");
  }
  EXPECT_EQ(CodeOf(stranger.Get("/v1/collections",
                                {{"Authorization", "Bearer " + read}, {"X-API-Key", read}})),
            "unauthorized");

  // What is kept is no key, and the log has its id only.
  EXPECT_EQ(server.Stop(), 0);
  std::ifstream file(database(), std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  for (const std::string& key : {read, write, admin}) {
    const std::string secret = key.substr(13);
    EXPECT_THAT(bytes.str(), Not(HasSubstr(secret)));
    EXPECT_THAT(server.Log(), Not(HasSubstr(secret)));
    EXPECT_THAT(server.Log(), HasSubstr("key=" + key.substr(4, 8)));
  }
}

TEST_F(AuthTest, KeysOfPeersOpenOnlyWhatPeersAsk) {
  const std::string admin = Create("admin", "me");
  const std::string peer = Create("peer", "servers");
  ServerProcess server(database(), {"--auto-train", "false"});
  auto owner = With(server, admin);
  auto other = With(server, peer);
  const auto part = other.Get("/v1/peer");
  ASSERT_EQ(part->status, 200);
  EXPECT_EQ(Json::parse(part->body).value("parts", 0), 1);
  EXPECT_EQ(CodeOf(owner.Get("/v1/peer")), "forbidden");
  EXPECT_EQ(CodeOf(server.Client().Get("/v1/peer")), "unauthorized");
  EXPECT_EQ(CodeOf(other.Get("/v1/collections")), "forbidden");
  EXPECT_EQ(CodeOf(other.Get("/v1/keys")), "forbidden");
  const auto rank = [&](const std::string& query, const std::string& body) {
    return CodeOf(other.Post("/v1/peer/rank?" + query, body, "application/octet-stream"));
  };
  EXPECT_EQ(rank("part=1&parts=1", "nonsense"), "invalid_parameter");
  EXPECT_EQ(rank("part=2&parts=3", "nonsense"), "part_elsewhere");
  EXPECT_EQ(rank("parts=1", "nonsense"), "missing_parameter");
  EXPECT_EQ(other.Get("/v1/peer")->status, 200);
}

TEST_F(AuthTest, AKeyIsToldWhatItMayDo) {
  const ServerProcess server(database(), {"--auto-train", "false"});
  auto stranger = server.Client();
  const Json everybody = Json::parse(stranger.Get("/v1/me")->body);
  EXPECT_EQ(everybody, Json::parse(R"({"keys_required": false, "key": null,
                                       "scopes": ["read", "write", "admin"],
                                       "image_url": false, "backups": false})"));
  // A key that is not needed is not looked at.
  EXPECT_EQ(stranger.Get("/v1/me", {{"X-API-Key", "plk_00000000_x"}})->status, 200);
  const std::vector<std::pair<std::string, Json>> scopes = {
      {"read", {"read"}}, {"write", {"read", "write"}}, {"admin", {"read", "write", "admin"}}};
  for (const auto& [scope, allowed] : scopes) {
    const std::string key = Create(scope, "for " + scope);
    const auto answer = With(server, key).Get("/v1/me");
    ASSERT_EQ(answer->status, 200) << answer->body;
    EXPECT_EQ(answer->get_header_value("Cache-Control"), "no-store");
    const Json me = Json::parse(answer->body);
    EXPECT_EQ(me["keys_required"], true);
    EXPECT_EQ(me["scopes"], allowed);
    EXPECT_EQ(me["key"],
              (Json{{"id", key.substr(4, 8)}, {"name", "for " + scope}, {"scope", scope}}));
    EXPECT_THAT(answer->body, Not(HasSubstr(key.substr(13))));
  }
  EXPECT_EQ(CodeOf(stranger.Get("/v1/me")), "unauthorized");
  EXPECT_EQ(CodeOf(With(server, "plk_00000000_x").Get("/v1/me")), "unauthorized");
  EXPECT_EQ(CodeOf(stranger.Post("/v1/me")), "method_not_allowed");
}

TEST_F(AuthTest, KeysAreMadeAndRevokedOverHttp) {
  ServerProcess server(database(), {"--auto-train", "false"});
  auto anybody = server.Client();
  const auto make = [](httplib::Client& client, const std::string& name, const std::string& scope) {
    return client.Post("/v1/keys", Json{{"name", name}, {"scope", scope}}.dump(),
                       "application/json");
  };
  EXPECT_EQ(Json::parse(anybody.Get("/v1/keys")->body), Json::parse(R"({"keys": []})"));
  // Whoever makes the first one must be able to make more.
  EXPECT_EQ(CodeOf(make(anybody, "page", "read")), "first_key_admin");
  const auto first = make(anybody, "me", "admin");
  ASSERT_EQ(first->status, 201) << first->body;
  EXPECT_EQ(first->get_header_value("Cache-Control"), "no-store");
  const Json admin = Json::parse(first->body);
  EXPECT_THAT(admin["key"].get<std::string>(), MatchesRegex("plk_[0-9a-f]{8}_[A-Za-z0-9_-]{43}"));
  EXPECT_EQ(first->get_header_value("Location"), "/v1/keys/" + admin["id"].get<std::string>());
  EXPECT_EQ(CodeOf(anybody.Get("/v1/keys")), "unauthorized") << "it is closed from now on";

  auto owner = With(server, admin["key"]);
  const Json read = Json::parse(make(owner, "page", "read")->body);
  auto reader = With(server, read["key"]);
  EXPECT_EQ(reader.Get("/v1/collections")->status, 200) << "it works at once";
  EXPECT_EQ(CodeOf(reader.Get("/v1/keys")), "forbidden");
  EXPECT_EQ(CodeOf(make(reader, "more", "admin")), "forbidden");
  EXPECT_EQ(CodeOf(make(owner, "", "read")), "missing_parameter");
  for (const std::string name : {"a\nb", "\u202e"}) {
    const auto refused = make(owner, name, "read");
    EXPECT_EQ(CodeOf(refused), "invalid_parameter") << name;
    EXPECT_EQ(Json::parse(refused->body)["parameter"], "name");
  }

  const Json list = Json::parse(owner.Get("/v1/keys")->body)["keys"];
  ASSERT_EQ(list.size(), 2U);
  EXPECT_EQ(list[1]["name"], "page");
  EXPECT_EQ(list[1]["scope"], "read");
  EXPECT_TRUE(list[1]["revoked_at"].is_null());
  EXPECT_FALSE(list[1].contains("key"));
  EXPECT_FALSE(list[1].contains("hash"));

  const auto revoke = [&](const Json& key) {
    return owner.Delete("/v1/keys/" + key["id"].get<std::string>());
  };
  EXPECT_EQ(revoke(read)->status, 204);
  EXPECT_EQ(CodeOf(reader.Get("/v1/collections")), "unauthorized") << "at once, too";
  EXPECT_EQ(CodeOf(revoke(read)), "key_not_found");
  EXPECT_FALSE(Json::parse(owner.Get("/v1/keys")->body)["keys"][1]["revoked_at"].is_null());
  EXPECT_EQ(CodeOf(owner.Delete("/v1/keys/me")), "key_not_found") << "a name is no id";
  EXPECT_EQ(CodeOf(revoke(admin)), "last_admin_key");
  const Json second = Json::parse(make(owner, "me too", "admin")->body);
  EXPECT_EQ(revoke(admin)->status, 204) << "there is another one";
  EXPECT_EQ(With(server, second["key"]).Get("/v1/keys")->status, 200);

  // What is kept is no key, nor is what is logged.
  EXPECT_EQ(server.Stop(), 0);
  std::ifstream file(database(), std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  for (const Json& made : {admin, read, second}) {
    const std::string secret = made["key"].get<std::string>().substr(13);
    EXPECT_THAT(bytes.str(), Not(HasSubstr(secret)));
    EXPECT_THAT(server.Log(), Not(HasSubstr(secret)));
  }
}

TEST_F(AuthTest, ARunningServerFollowsTheCommandLine) {
  const ServerProcess server(database(), {"--auto-train", "false"});
  auto stranger = server.Client();
  EXPECT_EQ(stranger.Get("/v1/collections")->status, 200) << "no keys yet, and it is loopback";
  const std::string key = Create("read", "one");
  EXPECT_EQ(stranger.Get("/v1/collections")->status, 401);
  auto client = With(server, key);
  EXPECT_EQ(client.Get("/v1/collections")->status, 200);
  const Json list = Keys({"list", "--json"}).json()["keys"];
  ASSERT_EQ(list.size(), 1U);
  EXPECT_EQ(list[0]["name"], "one");
  EXPECT_EQ(list[0]["scope"], "read");
  EXPECT_TRUE(list[0]["revoked_at"].is_null());
  EXPECT_THAT(Keys({"list"}).out, Not(HasSubstr(key.substr(13))));

  EXPECT_EQ(Keys({"revoke", "nobody"}).status, 1);
  EXPECT_EQ(Keys({"revoke", "one"}).status, 0);
  EXPECT_EQ(client.Get("/v1/collections")->status, 401);
  EXPECT_EQ(stranger.Get("/v1/collections")->status, 401) << "the last key does not open it";
  EXPECT_EQ(Keys({"purge"}).status, 0);
  EXPECT_EQ(stranger.Get("/v1/collections")->status, 200);
}

TEST_F(AuthTest, ANewDatabaseIsMentionedOnceAndOnlyMadeForAKey) {
  for (const std::vector<std::string>& none :
       std::vector<std::vector<std::string>>{{"list"}, {"revoke", "one"}, {"purge"}}) {
    const ProgramResult result = Keys(none);
    EXPECT_EQ(result.status, 1);
    EXPECT_THAT(result.err, HasSubstr("there is no database " + database().string()));
  }
  EXPECT_FALSE(std::filesystem::exists(database()));
  const std::vector<std::string> create = {"create", "--name", "one", "--descriptor", "rootsift"};
  const std::string made = "Created a new database: " + database().string();
  EXPECT_THAT(Keys(create).err, HasSubstr(made));
  EXPECT_THAT(Keys(create).err, Not(HasSubstr(made)));
}

TEST_F(AuthTest, NamesThatSeveralKeysHaveAreNotRevoked) {
  const std::string first = Create("read", "same");
  Create("write", "same");
  const ProgramResult refused = Keys({"revoke", "same"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.err, HasSubstr("Several keys"));
  EXPECT_EQ(Keys({"revoke", first.substr(4, 8)}).status, 0);
  EXPECT_EQ(Keys({"revoke", "same"}).status, 0) << "one is left";
  EXPECT_EQ(Keys({"create", "--scope", "all", "--name", "x"}).status, 2);
  EXPECT_EQ(Keys({"create", "--scope", "read", "--name", ""}).status, 2);
}

TEST_F(AuthTest, BeyondLoopbackOnlyWithKeysOrWhenTold) {
  const std::vector<std::string> open = {"--db",      DatabaseOf(database()), "--listen",
                                         "0.0.0.0:0", "--descriptor",         "rootsift"};
  const ProgramResult refused = Program(open, {}, ServerPath()).Wait();
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("there are no API keys"));
  EXPECT_THAT(refused.err, HasSubstr("pliant-server keys create"));
  const auto starts = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = open;
    arguments.insert(arguments.end(), more.begin(), more.end());
    Program program(arguments, {}, ServerPath());
    while (program.IsRunning() && program.Out().find("listening on") == std::string::npos) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    program.Signal(SIGTERM);
    return program.Wait().status == 0;
  };
  EXPECT_TRUE(starts({"--allow-anonymous", "true"}));
  EXPECT_FALSE(starts({}));
  Create("read", "one");
  EXPECT_TRUE(starts({}));
}

TEST_F(AuthTest, TooManyRequestsOfOneKeyAreRefusedOthersAreNot) {
  const std::string eager = Create("read", "eager");
  const std::string calm = Create("read", "calm");
  const ServerProcess server(database(), {"--rate-limit", "1", "--rate-burst", "5"});
  auto client = With(server, eager);
  int refused = 0;
  for (int i = 0; i < 12; ++i) {
    const auto answer = client.Get("/v1/collections");
    if (answer->status == 200) continue;
    ASSERT_EQ(answer->status, 429) << answer->body;
    EXPECT_EQ(CodeOf(answer), "rate_limited");
    EXPECT_EQ(answer->get_header_value("Retry-After"), "1");
    ++refused;
  }
  EXPECT_GT(refused, 0);
  EXPECT_EQ(With(server, calm).Get("/v1/collections")->status, 200);
  EXPECT_EQ(client.Get("/livez")->status, 200);
}

}  // namespace
}  // namespace pliant::testing
