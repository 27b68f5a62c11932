// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// `pliant eval retrieval`: forms of its output, exit statuses; what every `pliant eval` refuses.
#include <algorithm>
#include <sstream>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include "tests/integration/charts.h"
#include "tests/integration/program.h"

namespace pliant::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;
using Json = nlohmann::json;

class EvalRetrievalTest : public ::testing::Test {
 protected:
  EvalRetrievalTest() {
    for (std::uint64_t i = 1; i <= 5; ++i) {
      WriteBytes(folder_ / ("set/o" + std::to_string(i) + "/ref.png"), OtherViewPng(i));
      WriteBytes(folder_ / ("set/o" + std::to_string(i) + "/view.png"), RandomPng(i));
    }
  }
  ProgramResult Eval(std::vector<std::string> more) {
    std::vector<std::string> arguments = {
        "eval",    "retrieval", (folder_ / "set").string(), "--descriptor", "rootsift",
        "--words", "20"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunProgram(arguments);
  }
  std::string Path(const std::string& name) { return (folder_ / name).string(); }

  TemporaryFolder folder_;
};

TEST_F(EvalRetrievalTest, JsonHasTheAgreedForm) {
  const ProgramResult result = Eval({"--json", "--seeds", "2"});
  ASSERT_EQ(result.status, 0) << result.err;
  const Json json = result.json();
  EXPECT_EQ(json["pictures"], 5);
  EXPECT_EQ(json["queries"], 5);
  EXPECT_EQ(json["layout"], "objects");
  EXPECT_EQ(json["seeds"], 2);
  ASSERT_THAT(json["results"], SizeIs(2));
  EXPECT_EQ(json["results"][0]["protocol"], "paper");
  EXPECT_EQ(json["results"][1]["protocol"], "default");
  for (const Json& row : json["results"]) {
    EXPECT_EQ(row["descriptor"], "rootsift");
    EXPECT_THAT(row["accuracy_at"], SizeIs(20));
    EXPECT_THAT(row["spread"]["accuracy_at"], SizeIs(20));
    EXPECT_TRUE(row["ns_score"].is_null());
    EXPECT_GT(row["seconds_per_query"].get<double>(), 0);
    EXPECT_GT(row["milliseconds"]["detect"].get<double>(), 0);
    EXPECT_GT(row["bytes_per_image"]["stored"].get<double>(), 0);
  }
  EXPECT_EQ(json["results"][1]["top1"], 1);
  EXPECT_EQ(json["results"][1]["map"], 1);
  EXPECT_EQ(json["results"][1]["object_top1"], 1);
  EXPECT_NEAR(json["results"][1]["accuracy_at"][4].get<double>(), 0.2, 1e-12);  // 1 of 5
}

TEST_F(EvalRetrievalTest, TableAndCsv) {
  const ProgramResult result = Eval({"--protocol", "paper,default,unverified", "--seeds", "1",
                                     "--csv", Path("t.csv"), "--descriptor", "orb"});
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("5 queries, 5 images of 5 objects"));
  EXPECT_THAT(result.out, HasSubstr("mAP"));
  EXPECT_THAT(result.out, HasSubstr("unverified"));
  const auto csv = ReadBytes(folder_ / "t.csv");
  std::istringstream lines(std::string(csv.begin(), csv.end()));
  std::vector<std::string> rows;
  for (std::string line; std::getline(lines, line);) rows.push_back(line);
  ASSERT_THAT(rows, SizeIs(7));  // the header, two descriptors in three protocols
  for (const std::string& row : rows) {
    EXPECT_EQ(std::count(row.begin(), row.end(), ','),
              std::count(rows[0].begin(), rows[0].end(), ','));
  }
  EXPECT_THAT(rows[0], HasSubstr("accuracy_at_20"));
  EXPECT_THAT(rows[4], HasSubstr("orb,paper,10,"));
}

TEST_F(EvalRetrievalTest, ChartsAreDrawnFromTheReport) {
  const ProgramResult result = Eval(
      {"--protocol", "paper,default,unverified", "--seeds", "2", "--descriptor", "orb", "--json"});
  ASSERT_EQ(result.status, 0) << result.err;
  ExpectCharts(result.out, 2 * 300);  // three charts, one per protocol, in two rows
}

TEST_F(EvalRetrievalTest, AnswersNameTheFirstHitsOfEveryQuery) {
  const ProgramResult result =
      Eval({"--protocol", "default", "--seeds", "2", "--answers", Path("a.csv")});
  ASSERT_EQ(result.status, 0) << result.err;
  const auto csv = ReadBytes(folder_ / "a.csv");
  std::istringstream lines(std::string(csv.begin(), csv.end()));
  std::string header;
  std::getline(lines, header);
  EXPECT_EQ(header,
            "descriptor,protocol,words,query,object,rank,hit,hit_object,right,score,probability,"
            "inliers,left_out");
  int first = 0;
  int left_out = 0;
  for (std::string line; std::getline(lines, line);) {
    EXPECT_EQ(std::count(line.begin(), line.end(), ','),
              std::count(header.begin(), header.end(), ','));
    if (line.find(",1,") == std::string::npos) continue;
    std::vector<std::string> cells;
    std::istringstream row(line);
    for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
    if (cells[12] == "1") {
      ++left_out;
      EXPECT_NE(cells[4], cells[7]);
      continue;
    }
    if (cells[5] != "1") continue;
    ++first;
    EXPECT_EQ(cells[4], cells[7]);  // here every first hit is right
    EXPECT_EQ(cells[8], "1");
    EXPECT_THAT(cells[6], HasSubstr("/" + cells[7] + "/"));
    EXPECT_NE(cells[3], cells[6]);
    EXPECT_GT(std::stoi(cells[11]), 5);
  }
  EXPECT_EQ(first, 5);  // of the first seed alone
  EXPECT_EQ(left_out, 5);
}

TEST_F(EvalRetrievalTest, AnswersQuoteNames) {
  std::filesystem::rename(folder_ / "set/o1", folder_ / "set/o1, \"old\"");
  const ProgramResult result =
      Eval({"--protocol", "unverified", "--seeds", "1", "--answers", Path("a.csv")});
  ASSERT_EQ(result.status, 0) << result.err;
  const auto csv = ReadBytes(folder_ / "a.csv");
  const std::string text(csv.begin(), csv.end());
  EXPECT_THAT(text, HasSubstr("/o1, \"\"old\"\"/ref.png\",\"o1, \"\"old\"\"\",1,\""));
  const ProgramResult refused = Eval({"--answers", Path("nowhere/a.csv"), "--json"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_EQ(refused.json()["error"]["code"], "write_failed");
}

TEST_F(EvalRetrievalTest, RanksByHistograms) {
  const ProgramResult result =
      Eval({"--protocol", "default,unverified", "--seeds", "1", "--rank", "histogram", "--json"});
  ASSERT_EQ(result.status, 0) << result.err;
  const Json rows = result.json()["results"];
  ASSERT_THAT(rows, SizeIs(2));
  EXPECT_EQ(rows[0]["milliseconds"]["verify"], 0);
  EXPECT_EQ(rows[0]["map"], rows[1]["map"]);
}

TEST_F(EvalRetrievalTest, PeersAreListedBesideOurs) {
  const Json peer = {{"descriptor", "other"},
                     {"protocol", "words"},
                     {"accuracy_at", std::vector<double>(20, 0.25)},
                     {"map", 0.5},
                     {"top1", 0.25},
                     {"mrr", 0.75},
                     {"seconds_per_query", 0.125}};
  Json file = {{"pictures", 5}, {"queries", 5}, {"results", {peer}}};
  WriteText(folder_ / "peer.json", file.dump());
  const std::vector<std::string> arguments = {
      "--json", "--seeds", "1", "--protocol", "unverified", "--peers", Path("peer.json")};
  const ProgramResult result = Eval(arguments);
  ASSERT_EQ(result.status, 0) << result.err;
  ASSERT_THAT(result.json()["results"], SizeIs(2));
  const Json row = result.json()["results"][1];
  for (const char* key :
       {"descriptor", "protocol", "accuracy_at", "map", "top1", "mrr", "seconds_per_query"}) {
    EXPECT_EQ(row[key], peer[key]) << key;
  }

  file["queries"] = 6;
  WriteText(folder_ / "peer.json", file.dump());
  ProgramResult wrong = Eval(arguments);
  EXPECT_EQ(wrong.status, 1);
  EXPECT_EQ(wrong.json()["error"]["code"], "peers_differ");
  file["queries"] = 5;
  file["results"][0]["accuracy_at"] = {1, 2};
  WriteText(folder_ / "peer.json", file.dump());
  EXPECT_EQ(Eval(arguments).json()["error"]["code"], "peers_invalid");
  WriteText(folder_ / "peer.json", "{}");
  EXPECT_EQ(Eval(arguments).json()["error"]["code"], "peers_invalid");
}

TEST_F(EvalRetrievalTest, ListsWhatWouldBeMeasured) {
  const ProgramResult result = RunProgram({"eval", "retrieval", Path("set"), "--list"});
  ASSERT_EQ(result.status, 0) << result.err;
  const Json json = result.json();
  EXPECT_EQ(json["counts_itself"], false);
  ASSERT_THAT(json["pictures"], SizeIs(10));
  EXPECT_EQ(json["pictures"][0]["object"], "o1");
  EXPECT_EQ(json["pictures"][0]["query"], true);
  EXPECT_EQ(json["pictures"][1]["searched"], true);
}

TEST_F(EvalRetrievalTest, SkippedImagesAreNamed) {
  WriteText(folder_ / "set/o1/broken.jpg", "no image");
  const ProgramResult result = Eval({"--json", "--seeds", "1", "--protocol", "unverified"});
  EXPECT_EQ(result.status, 3);
  EXPECT_THAT(result.err, HasSubstr("broken.jpg"));
  ASSERT_THAT(result.json()["skipped"], SizeIs(1));
  EXPECT_THAT(result.json()["skipped"][0]["file"].get<std::string>(), HasSubstr("o1/broken.jpg"));
  EXPECT_EQ(result.json()["pictures"], 6);  // what is skipped counts as missed
}

// Of two things that are wrong, the file is told: it was looked at before any work.
TEST_F(EvalRetrievalTest, FilesThatCannotBeWrittenAreRefusedBeforeTheWork) {
  std::filesystem::create_directory(folder_ / "taken.csv");
  for (const std::string command : {"matching", "retrieval", "tracking"}) {
    for (const std::string& file :
         {Path("nowhere/t.csv"), Path("taken.csv"), std::string("/dev/null/t.csv")}) {
      SCOPED_TRACE(command + " " + file);
      const ProgramResult refused =
          RunProgram({"eval", command, Path("absent"), "--csv", file, "--json"});
      EXPECT_EQ(refused.status, 1);
      EXPECT_EQ(refused.json()["error"]["code"], "write_failed");
      EXPECT_THAT(refused.err, HasSubstr(file));
    }
    const ProgramResult writable =
        RunProgram({"eval", command, Path("absent"), "--csv", Path("t.csv"), "--json"});
    EXPECT_EQ(writable.status, 1);
    EXPECT_NE(writable.json()["error"]["code"], "write_failed");
  }
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
    left.push_back(entry.path().filename());
  EXPECT_THAT(left, ::testing::UnorderedElementsAre("set", "taken.csv"))
      << "looking leaves nothing";
}

TEST_F(EvalRetrievalTest, TwoDoNotWorkInOneCache) {
  const std::filesystem::path cache = folder_ / "cache";
  std::filesystem::create_directories(cache);
  const int other = ::open(cache.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  ASSERT_EQ(::flock(other, LOCK_EX), 0);
  const ProgramResult refused = Eval({"--cache", cache.string()});
  EXPECT_NE(refused.status, 0);
  EXPECT_THAT(refused.err, HasSubstr("another evaluation is running in"));
  ::close(other);
  EXPECT_EQ(Eval({"--cache", cache.string()}).status, 0);
}

TEST_F(EvalRetrievalTest, WrongUsageAndBadFolders) {
  EXPECT_EQ(RunProgram({"eval"}).status, 2);
  EXPECT_EQ(RunProgram({"eval", "retrieval"}).status, 2);
  EXPECT_EQ(Eval({"--protocol", "best"}).status, 2);
  EXPECT_EQ(Eval({"--seeds", "0"}).status, 2);
  EXPECT_EQ(Eval({"--layout", "heap"}).status, 2);
  EXPECT_EQ(Eval({"--descriptor", "nonsense"}).status, 2);
  const ProgramResult absent = RunProgram({"eval", "retrieval", Path("absent")});
  EXPECT_EQ(absent.status, 1);
  EXPECT_THAT(absent.err, HasSubstr("absent"));
  std::filesystem::create_directory(folder_ / "empty");
  const ProgramResult empty = RunProgram({"eval", "retrieval", Path("empty"), "--json"});
  EXPECT_EQ(empty.status, 1);
  EXPECT_EQ(empty.json()["error"]["code"], "layout_unknown");
}

}  // namespace
}  // namespace pliant::testing
