// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The command line on databases: what is wrong with them, their vocabularies, looking after them.
#include <algorithm>

#include <gmock/gmock.h>

#include "tests/integration/cli_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

TEST_F(CliTest, FailuresSayWhyAndAreJsonWhenAsked) {
  const ProgramResult missing = RunProgram({"query", "nowhere.png", "--db", db_, "--json"});
  EXPECT_EQ(missing.status, 1);
  EXPECT_EQ(missing.json()["error"]["code"], "cannot_read");
  EXPECT_THAT(missing.err, HasSubstr("nowhere.png"));
  WriteBytes(folder_ / "q.png", RandomPng(1));
  const std::string q = (folder_ / "q.png").string();
  for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{
           {"query", "--json", "--db", db_}, {"query", q, "--db", db_, "--json", "--top", "x"}}) {
    const ProgramResult usage = RunProgram(wrong);
    EXPECT_EQ(usage.status, 2);
    EXPECT_EQ(usage.json()["error"]["code"], "wrong_usage") << usage.err;
  }
  EXPECT_EQ(RunProgram({"query", q, "--db", db_, "--json"}).json()["error"]["code"],
            "database_not_found");
  EXPECT_FALSE(std::filesystem::exists(db_));
  WriteText(db_, "not a database at all");
  for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
           {"query", q, "--db", db_, "--json"},
           {"index", folder_.path().string(), "--db", db_, "--json", "--descriptor", "orb"},
           {"db", "check", "--db", db_, "--json"}}) {
    const ProgramResult foreign = RunProgram(arguments);
    EXPECT_EQ(foreign.status, 1);
    EXPECT_EQ(foreign.json()["error"]["code"], "not_a_database");
  }
  std::filesystem::remove(db_);
  EXPECT_EQ(RunProgram({"index", "/nowhere/at/all", "--db", db_}).status, 1);
  std::filesystem::create_directory(folder_ / "empty");
  const ProgramResult empty = RunProgram(
      {"index", (folder_ / "empty").string(), "--db", db_, "--descriptor", "orb", "--json"});
  EXPECT_EQ(empty.status, 0);
  EXPECT_EQ(empty.json()["indexed"], 0);
  EXPECT_TRUE(empty.json()["vocabulary"].is_null());
  EXPECT_THAT(empty.err, HasSubstr("no images"));
  EXPECT_EQ(RunProgram({"query", q, "--db", db_, "--json"}).json()["error"]["code"],
            "no_vocabulary");
  WriteObjects(1);
  const ProgramResult mismatch = Index();
  EXPECT_EQ(mismatch.status, 1);
  EXPECT_EQ(mismatch.json()["error"]["code"], "model_mismatch");
  EXPECT_EQ(RunProgram({"index", objects_, "--db", db_, "--descriptor", "nonsense"}).status, 2);
}

TEST_F(CliTest, VocabulariesFromTheCommandLine) {
  WriteObjects(5);
  ASSERT_EQ(Index().status, 0);
  const ProgramResult trained = RunProgram(
      {"vocab", "train", "--db", db_, "--words", "20", "--sample", "300", "--seed", "9", "--json"});
  ASSERT_EQ(trained.status, 0) << trained.err;
  EXPECT_EQ(trained.json()["words"], 20);
  EXPECT_EQ(trained.json()["active"], false);
  EXPECT_EQ(trained.json()["seed"], 9);
  EXPECT_EQ(trained.json()["sampled"], 300);
  EXPECT_EQ(Query(2)["vocabulary"], 1);
  ASSERT_EQ(RunProgram({"vocab", "use", "2", "--db", db_}).status, 0);
  EXPECT_EQ(Query(2)["vocabulary"], 2);
  EXPECT_EQ(Query(2)["words"], 20);
  const Json list = RunProgram({"vocab", "list", "--json", "--db", db_}).json()["vocabularies"];
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0]["active"], false);
  EXPECT_EQ(list[1]["active"], true);
  EXPECT_THAT(RunProgram({"vocab", "list", "--db", db_}).out, HasSubstr("in use"));
  EXPECT_EQ(RunProgram({"vocab", "use", "7", "--db", db_}).status, 1);
  EXPECT_EQ(RunProgram({"vocab", "train", "--words", "301", "--sample", "300", "--db", db_}).status,
            2);
  EXPECT_EQ(RunProgram({"db", "check", "--db", db_}).out, "ok\n");
}

// That NumPy reads what is written is the tests' of Python.
TEST_F(CliTest, ExportsFeaturesAndRecords) {
  WriteObjects(4);
  ASSERT_EQ(Index().status, 0);
  const auto run = [&](const std::string& name, std::vector<std::string> more = {}) {
    more.insert(more.begin(), {"db", "export", (folder_ / name).string(), "--db", db_, "--json"});
    return RunProgram(more);
  };
  for (const std::string name : {"x.npz", "x.ndjson", "x.csv"}) {
    const ProgramResult result = run(name);
    ASSERT_EQ(result.status, 0) << result.err;
    EXPECT_EQ(result.json()["images"], 4);
    EXPECT_EQ(result.json()["bytes"], std::filesystem::file_size(folder_ / name));
  }
  const auto start = [&](const std::string& name) {
    const std::vector<std::uint8_t> bytes = ReadBytes(folder_ / name);
    return std::string(bytes.begin(), bytes.begin() + 4);
  };
  EXPECT_EQ(start("x.npz"), "PK\x03\x04");
  EXPECT_EQ(start("x.csv"), "id,o");
  const std::vector<std::uint8_t> lines = ReadBytes(folder_ / "x.ndjson");
  EXPECT_EQ(std::count(lines.begin(), lines.end(), '\n'), 4);
  EXPECT_EQ(Json::parse(lines.begin(), std::find(lines.begin(), lines.end(), '\n'))["collection"],
            "default");
  EXPECT_EQ(run("o2.npz", {"--object", "o2"}).json()["images"], 1);
  EXPECT_EQ(run("none.npz", {"--filter", R"({"year": 3})"}).json()["images"], 0);
  EXPECT_EQ(run("x.npz", {"--filter", "x"}).status, 2);
  EXPECT_EQ(run("x.npz", {"--collection", "none"}).json()["error"]["code"], "collection_not_found");
  for (const std::string name : {"x.txt", "x.h5", "x.safetensors"}) {
    EXPECT_EQ(run(name).json()["error"]["code"], "bad_export_name");
  }
  EXPECT_EQ(run("nowhere/x.npz").json()["error"]["code"], "write_failed");
  const std::vector<std::uint8_t> before = ReadBytes(folder_ / "x.npz");
  for (const std::string name : {"x.npz", "x.ndjson"}) {
    const ProgramResult full =
        RunProgram({"db", "export", (folder_ / name).string(), "--db", db_, "--json"},
                   {.max_file_bytes = 500});
    EXPECT_EQ(full.status, 1) << name;
    EXPECT_EQ(full.json()["error"]["code"], "write_failed") << full.out;
  }
  EXPECT_EQ(ReadBytes(folder_ / "x.npz"), before);
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    EXPECT_EQ(entry.path().string().find(".part-"), std::string::npos) << entry.path();
  }
}

TEST_F(CliTest, NoNameAPagePastTheEndAndARegionOutsideAreSaid) {
  WriteObjects(2);
  for (const std::vector<std::string>& unnamed :
       std::vector<std::vector<std::string>>{{"index", objects_}, {"db", "check"}}) {
    std::vector<std::string> arguments = unnamed;
    arguments.insert(arguments.end(), {"--db", ""});
    const ProgramResult result = RunProgram(arguments);
    EXPECT_EQ(result.status, 2);
    EXPECT_THAT(result.err, HasSubstr("the name of the database is empty"));
  }
  ASSERT_EQ(Index().status, 0);
  WriteBytes(folder_ / "q.png", OtherViewPng(1));
  const std::vector<std::string> query = {"query", (folder_ / "q.png").string(), "--db", db_};
  const auto with = [&](const std::string& flag, const std::string& value) {
    std::vector<std::string> arguments = query;
    arguments.insert(arguments.end(), {flag, value});
    return RunProgram(arguments);
  };
  EXPECT_THAT(with("--offset", "50").out, HasSubstr("--offset is beyond the last of 2 hits"));
  EXPECT_THAT(with("--region", "5000,0,10,10").err,
              HasSubstr("lies outside the query image of 160 x 120 pixels"));
}

TEST_F(CliTest, WrongValuesAreNamedByTheirFlags) {
  WriteObjects(2);
  ASSERT_EQ(Index().status, 0);
  WriteBytes(folder_ / "q.png", OtherViewPng(1));
  const std::string q = (folder_ / "q.png").string();
  const auto says = [&](std::vector<std::string> arguments, bool database = true) {
    if (database) arguments.insert(arguments.end(), {"--db", db_});
    const ProgramResult result = RunProgram(arguments);
    EXPECT_EQ(result.status, 2) << result.err;
    EXPECT_EQ(result.err.find("q.png"), std::string::npos) << "it is not the photo's fault";
    return result.err;
  };
  EXPECT_THAT(says({"query", q, "--min-score", "2"}), StartsWith("--min-score: must be"));
  EXPECT_THAT(says({"query", q, "--top", "1.5"}), StartsWith("--top: must be a whole number"));
  EXPECT_THAT(says({"query", q, "--filter", "{bad"}), StartsWith("pliant: --filter: must be"));
  EXPECT_THAT(says({"query", q, "--filter", R"({"a": {"like": 1}})"}),
              StartsWith("pliant: --filter: filter.a: unknown test"));
  EXPECT_THAT(says({"query", q, "--region", "0,0,-1,9"}), StartsWith("pliant: --region must have"));
  EXPECT_THAT(says({"query", q, "--unwarp", "flat.gif"}), HasSubstr("flat.gif: cannot write .gif"));
  EXPECT_THAT(says({"index", objects_, "--collection", "a b"}),
              StartsWith("pliant: --collection: A collection name must be"));
  EXPECT_THAT(says({"selftest", "--false-alarms", "2"}), StartsWith("--false-alarms: must be"));
  EXPECT_THAT(says({"selftest", "--seed", "-1"}), StartsWith("--seed: must be 0 or more"));
  EXPECT_THAT(says({"vocab", "train", "--words", "90000"}), StartsWith("pliant: --words must be"));
  EXPECT_THAT(says({"db", "originals", ""}), StartsWith("DIR|database: must not be empty"));
  EXPECT_THAT(says({"db", "copy", "copy.db", "--compare", "-1"}), StartsWith("--compare: must be"));
  EXPECT_THAT(says({"match", objects_, q, "--ratio", "2"}, false), StartsWith("--ratio: must be"));
  EXPECT_THAT(says({"eval", "matching", objects_, "--tolerance", "0"}, false),
              StartsWith("--tolerance: must be"));
  EXPECT_THAT(says({"eval", "tracking", objects_, "--max-ratio", "2"}, false),
              StartsWith("--max-ratio: must be"));
  EXPECT_THAT(says({"simulate", "--textures", "procedural", "--out", "x", "--turn", "-1"}, false),
              StartsWith("--turn: must be"));
}

TEST_F(CliTest, RemovingAnObjectThatDoesNotExist) {
  WriteObjects(1);
  ASSERT_EQ(Index().status, 0);
  const ProgramResult removed = RunProgram({"db", "rm", "no-id", "--object", "nix", "--db", db_});
  EXPECT_EQ(removed.status, 3);
  EXPECT_THAT(removed.err, HasSubstr("skipped no-id: no image has this id"));
  EXPECT_THAT(removed.err, HasSubstr("skipped nix: no object has this name"));
}

TEST_F(CliTest, StatisticsOfOneCollectionAndOfAll) {
  WriteObjects(2);
  ASSERT_EQ(Index().status, 0);
  WriteObjects(3);
  ASSERT_EQ(Index({"--collection", "other"}).status, 0);
  const auto stats = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"db", "stats", "--db", db_, "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunProgram(arguments).json();
  };
  const Json all = stats({});
  EXPECT_EQ(all["images"], 5);
  ASSERT_EQ(all["collections"].size(), 2U);
  const Json& first = all["collections"][0];
  EXPECT_EQ(first["name"], "default");
  EXPECT_EQ(first["images"], 2);
  EXPECT_FALSE(all.contains("vocabulary")) << "each collection has its own";
  const Json other = stats({"--collection", "other"});
  EXPECT_EQ(other["collections"], Json::array({all["collections"][1]}));
  const Json& only = other["collections"][0];
  EXPECT_EQ(only["name"], "other");
  EXPECT_EQ(only["images"], 3);
  EXPECT_EQ(only["objects"], 3);
  EXPECT_EQ(first["descriptors"].get<int>() + only["descriptors"].get<int>(), all["descriptors"]);
  EXPECT_EQ(other["images"], 5) << "totals and sizes are those of the database";
  EXPECT_NE(only["vocabulary"]["id"], first["vocabulary"]["id"]);
  EXPECT_EQ(stats({"--collection", "none"})["error"]["code"], "collection_not_found");
  EXPECT_THAT(RunProgram({"db", "stats", "--db", db_}).out,
              AllOf(HasSubstr("collection   default: 2 images, 2 objects, "),
                    HasSubstr("collection   other: 3 images, 3 objects, "),
                    HasSubstr("together     5 images, 5 objects, ")));
  for (const std::vector<std::string>& whole :
       std::vector<std::vector<std::string>>{{"check"},
                                             {"backup", "x.db"},
                                             {"restore", "x.db"},
                                             {"copy", "x.db"},
                                             {"originals", "x"}}) {
    std::vector<std::string> arguments = {"db"};
    arguments.insert(arguments.end(), whole.begin(), whole.end());
    arguments.insert(arguments.end(), {"--db", db_, "--collection", "other"});
    const ProgramResult refused = RunProgram(arguments);
    EXPECT_EQ(refused.status, 2) << whole[0];
    EXPECT_THAT(refused.err, HasSubstr("does not take --collection"));
  }
}

TEST_F(CliTest, TheCheckSaysWhatHelpsAgainstMissingOriginals) {
  WriteObjects(2);
  ASSERT_EQ(Index({"--originals-dir", (folder_ / "kept").string()}).status, 0);
  std::filesystem::rename(folder_ / "kept", folder_ / "moved");
  const ProgramResult missing = RunProgram({"db", "check", "--db", db_});
  EXPECT_EQ(missing.status, 1);
  EXPECT_THAT(missing.out, HasSubstr("its original is not in"));
  EXPECT_THAT(missing.err, HasSubstr("--originals-dir"));
  EXPECT_THAT(missing.err, Not(HasSubstr("db restore"))) << "a backup does not have them";
  EXPECT_EQ(
      RunProgram({"db", "check", "--db", db_, "--originals-dir", (folder_ / "moved").string()}).out,
      "ok\n");
}

TEST_F(CliTest, LookingAfterADatabase) {
  WriteObjects(5);
  ASSERT_EQ(Index().status, 0);
  Json stats = RunProgram({"db", "stats", "--db", db_, "--json"}).json();
  EXPECT_EQ(stats["images"], 5);
  EXPECT_EQ(stats["objects"], 5);
  EXPECT_EQ(stats["descriptor"], "rootsift");
  EXPECT_GT(stats["index_bytes"], 0);
  EXPECT_EQ(stats["collections"][0]["vocabulary"]["id"], 1);
  EXPECT_THAT(RunProgram({"db", "stats", "--db", db_}).out, HasSubstr("default: 5 images"));

  const std::string copy = (folder_ / "copy.db").string();
  const ProgramResult backup = RunProgram({"db", "backup", copy, "--db", db_, "--json"});
  EXPECT_EQ(backup.status, 0) << backup.err;
  EXPECT_EQ(backup.json()["bytes"], std::filesystem::file_size(copy));
  EXPECT_EQ(RunProgram({"db", "backup", copy, "--db", db_}).status, 1);
  EXPECT_EQ(RunProgram({"db", "check", "--db", copy, "--json"}).json(),
            (Json{{"ok", true}, {"problems", Json::array()}}));

  const std::string id = Query(3)["hits"][0]["image_id"];
  const ProgramResult removed = RunProgram({"db", "rm", id, "nobody", "--db", db_, "--json"});
  EXPECT_EQ(removed.status, 3);
  EXPECT_EQ(removed.json(), (Json{{"removed", 1}, {"missing", {"nobody"}}}));
  EXPECT_NE(Query(3)["hits"][0]["image_id"], id);
  EXPECT_EQ(RunProgram({"db", "rm", "--object", "o1", "--db", db_}).status, 0);
  EXPECT_EQ(RunProgram({"db", "rm", "--db", db_}).status, 2);
  EXPECT_EQ(RunProgram({"db", "stats", "--db", db_, "--json"}).json()["images"], 3);

  // A byte in the middle of some image's features.
  std::vector<std::uint8_t> bytes = ReadBytes(copy);
  const std::string magic = "PLFT";
  const auto at = std::search(bytes.begin(), bytes.end(), magic.begin(), magic.end());
  ASSERT_NE(at, bytes.end());
  at[40] ^= 1;
  WriteBytes(copy, bytes);
  EXPECT_THAT(RunProgram({"db", "check", "--db", copy}).err, HasSubstr("db restore BACKUP"));
  const ProgramResult broken = RunProgram({"db", "check", "--db", copy, "--json"});
  EXPECT_EQ(broken.status, 1);
  EXPECT_EQ(broken.json()["ok"], false);
  EXPECT_THAT(broken.json()["problems"][0].get<std::string>(), HasSubstr("checksum"));
}

}  // namespace
}  // namespace pliant::testing
