// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The command line as scripts use it: indexing, asking, describing; JSON forms and exit statuses.
#include <sstream>

#include <gmock/gmock.h>
#include <sys/stat.h>

#include "tests/integration/cli_fixture.h"

namespace pliant::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

// The names below "Subcommands:".
std::vector<std::string> SubcommandsIn(const std::string& help) {
  std::vector<std::string> names;
  std::istringstream lines(help);
  std::string line;
  while (std::getline(lines, line) && line != "Subcommands:") {
  }
  while (std::getline(lines, line) && line.starts_with("  ")) {
    if (line[2] != ' ') names.push_back(line.substr(2, line.find(' ', 2) - 2));
  }
  return names;
}

int ExpectExamples(const std::vector<std::string>& command) {
  std::vector<std::string> asked = command;
  asked.push_back("--help");
  const ProgramResult help = RunProgram(asked);
  EXPECT_EQ(help.status, 0);
  std::string name = "pliant";
  for (const std::string& word : command) name += " " + word;
  const std::vector<std::string> below = SubcommandsIn(help.out);
  if (!command.empty()) {
    EXPECT_THAT(help.out, HasSubstr("Example:  " + name + " ")) << help.out;
  }
  int count = 1;
  for (const std::string& word : below) {
    std::vector<std::string> longer = command;
    longer.push_back(word);
    count += ExpectExamples(longer);
  }
  return count;
}

TEST_F(CliTest, EveryHelpHasAnExample) { EXPECT_GE(ExpectExamples({}), 22); }

TEST_F(CliTest, HelpAndVersionAndWrongUsage) {
  const ProgramResult version = RunProgram({"--version"});
  EXPECT_EQ(version.status, 0);
  EXPECT_THAT(version.out, StartsWith("pliant "));
  for (const char* command : {"index", "query", "vocab", "db", "describe"}) {
    EXPECT_THAT(RunProgram({"--help"}).out, HasSubstr(command));
    const ProgramResult help = RunProgram({command, "--help"});
    EXPECT_EQ(help.status, 0);
    EXPECT_THAT(help.out, HasSubstr("Example:  pliant " + std::string(command)));
  }
  for (const std::vector<std::string>& wrong :
       std::vector<std::vector<std::string>>{{},
                                             {"nonsense"},
                                             {"index"},
                                             {"index", "."},
                                             {"index", ".", "--db"},
                                             {"query", "--db", "x"},
                                             {"query", "x", "--db", "x", "--rank", "best"},
                                             {"query", "x", "--db", "x", "--top", "-1"},
                                             {"query", "x", "--db", "x", "--region", "1,2,3"},
                                             {"query", "x", "--db", "x", "--max-keypoints", "9"},
                                             {"index", ".", "--db", "x", "--max-keypoints", "0"},
                                             {"index", ".", "--db", "x", "--object-from", "me"},
                                             {"vocab", "--db", "x"},
                                             {"vocab", "use", "--db", "x"},
                                             {"db", "stats"},
                                             {"db", "backup", "--db", "x"},
                                             {"describe", "x"},
                                             {"index", ".", "--db", "x", "--frobnicate"}}) {
    const ProgramResult result = RunProgram(wrong);
    EXPECT_EQ(result.status, 2) << ::testing::PrintToString(wrong);
    EXPECT_THAT(result.out, IsEmpty());
    EXPECT_FALSE(result.err.empty());
  }
}

// What bash offers when the last of the words is completed.
std::string Offered(const std::string& words) {
  const std::string script = "source " PLIANT_SOURCE_DIR
                             "/index/usage/completion.sh; COMP_WORDS=(" +
                             PliantPath().string() + " " + words +
                             "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _pliant_complete; "
                             "echo \"${COMPREPLY[*]}\"";
  const ProgramResult result = Program({"-c", script}, {}, "/bin/bash").Wait();
  EXPECT_EQ(result.err, "");
  return result.out;
}

TEST_F(CliTest, BashCompletes) {
  EXPECT_EQ(Offered("que"), "query\n");
  EXPECT_THAT(Offered("\"\""), StartsWith("index query selftest vocab db "));
  EXPECT_EQ(Offered("db ex"), "export\n");
  EXPECT_EQ(Offered("db export x.npz --ob"), "--object\n");
  EXPECT_EQ(Offered("index objects --j"), "--jobs --json\n");
  EXPECT_EQ(Offered("query x.jpg --group-by im"), "image\n");
  EXPECT_EQ(Offered("query x.jpg --group-by = im"), "image\n") << "as bash splits --group-by=im";
  EXPECT_EQ(Offered("query x.jpg --group-by ="), "object image\n");
  EXPECT_EQ(Offered("query x.jpg --top 4"), "\n") << "nothing: bash offers files";
}

TEST_F(CliTest, IndexTrainsAndQueryFinds) {
  WriteObjects(8);
  const ProgramResult indexed = Index();
  EXPECT_EQ(indexed.status, 0) << indexed.err;
  EXPECT_THAT(indexed.err, HasSubstr("no vocabulary yet"));
  const Json json = indexed.json();
  EXPECT_EQ(json["indexed"], 8);
  EXPECT_EQ(json["unchanged"], 0);
  EXPECT_EQ(json["skipped"], Json::array());
  EXPECT_EQ(json["vocabulary"]["id"], 1);
  EXPECT_EQ(json["vocabulary"]["trained"], true);
  EXPECT_GT(json["vocabulary"]["words"], 50);
  EXPECT_GT(json["seconds"], 0.0);
  for (const char* rank : {"neighbours", "histogram"}) {
    for (std::uint64_t i = 1; i <= 8; ++i) {
      const Json found = Query(i, {"--rank", rank});
      EXPECT_EQ(found["hits"][0]["object"], "o" + std::to_string(i));
    }
  }
  const Json found = Query(3, {"--top", "2", "--group-by", "image"});
  EXPECT_EQ(found["hits"].size(), 2u);
  EXPECT_EQ(found["vocabulary"], 1);
  EXPECT_GT(found["took_ms"], 0.0);
  const Json& hit = found["hits"][0];
  EXPECT_EQ(hit["rank"], 1);
  EXPECT_EQ(hit["image_id"].get<std::string>().size(), 32u);
  EXPECT_GT(hit["inliers"], 10);
  EXPECT_GE(hit["polygon"].size(), 3u);
  const Json unverified = Query(3, {"--verify", "none"})["hits"][0];
  EXPECT_EQ(unverified["object"], "o3");
  EXPECT_EQ(unverified["inliers"], 0);
  EXPECT_TRUE(unverified["polygon"].is_null());
  EXPECT_LE(unverified["score"], hit["score"]);
  EXPECT_EQ(hit["metadata"], Json::object());
  EXPECT_GT(hit["score"], found["hits"][1]["score"]);
  EXPECT_LT(Query(3, {"--region", "0,0,80,120"})["keypoints"], found["keypoints"]);
  EXPECT_EQ(Query(3, {"--object", "o4"})["hits"][0]["object"], "o4");

  EXPECT_EQ(Query(3, {"--top", "0", "--verify-depth", "2"})["hits"].size(), 8u);
  EXPECT_EQ(Query(3, {"--filter", R"({"year": {"gte": 2020}})"})["total"], 0);
  EXPECT_EQ(hit["instances"][0]["inliers"], hit["inliers"]);
  const ProgramResult bad = RunProgram({"query", (folder_ / "query.png").string(), "--db", db_,
                                        "--filter", R"({"year": {"like": 1}})"});
  EXPECT_NE(bad.status, 0);
  EXPECT_THAT(bad.err, HasSubstr("like"));
  const Json explained = Query(3, {"--explain"})["hits"][0];
  EXPECT_FALSE(hit.contains("explain"));
  EXPECT_EQ(explained["explain"]["verified"], true);
  EXPECT_EQ(explained["explain"]["pairs"].size(), explained["inliers"]);
  EXPECT_EQ(explained["explain"]["pairs"][0].size(), 4u);
  const Json& mesh = explained["explain"]["mesh"];
  EXPECT_EQ(mesh["points"].size(),
            mesh["columns"].get<std::size_t>() * mesh["rows"].get<std::size_t>());

  const ProgramResult text = RunProgram({"query", (folder_ / "query.png").string(), "--db", db_});
  EXPECT_EQ(text.status, 0);
  EXPECT_THAT(text.out, StartsWith("rank   score  probability  inliers  object"));
  EXPECT_THAT(text.out, HasSubstr("view.png"));
}

TEST_F(CliTest, TheSmallNetworkIndexesAndFinds) {
  WriteObjects(4);
  const auto index = [&](const std::string& descriptor) {
    return RunProgram({"index", objects_, "--db", db_, "--descriptor", descriptor, "--json"});
  };
  const ProgramResult indexed = index("deal-small");
  ASSERT_EQ(indexed.status, 0) << indexed.err;
  EXPECT_EQ(indexed.json()["indexed"], 4);
  EXPECT_EQ(Query(3)["hits"][0]["object"], "o3") << "with the descriptor of the database";
  for (const char* other : {"deal", "rootsift"}) {
    EXPECT_EQ(index(other).json()["error"]["code"], "model_mismatch");
  }
}

TEST_F(CliTest, IndexingAgainIsNoWorkAndNewImagesJoin) {
  WriteObjects(4);
  ASSERT_EQ(Index().status, 0);
  Json json = Index().json();
  EXPECT_EQ(json["indexed"], 0);
  EXPECT_EQ(json["unchanged"], 4);
  EXPECT_EQ(json["vocabulary"]["trained"], false);
  WriteObjects(6);
  json = Index().json();
  EXPECT_EQ(json["indexed"], 2);
  EXPECT_EQ(json["unchanged"], 4);
  EXPECT_EQ(Query(6)["hits"][0]["object"], "o6");
}

TEST_F(CliTest, BadFilesAreSkippedWithReasons) {
  WriteObjects(3);
  const std::vector<std::uint8_t> png = RandomPng(50);
  WriteText(folder_ / "objects" / "empty.jpg", "");
  WriteText(folder_ / "objects" / "text.png", "this is no image");
  WriteText(folder_ / "objects" / "notes.txt", "ignored");
  WriteBytes(folder_ / "objects" / "cut.png", {png.begin(), png.begin() + 300});
  WriteBytes(folder_ / "objects" / "plain.png",
             EncodePng({64, 64, 1, std::vector<std::uint8_t>(4096, 9)}));
  WriteBytes(folder_ / "objects" / ".hidden.png", RandomPng(51));
  WriteBytes(folder_ / "objects" / "o1" / "image-without-extension", RandomPng(52));
  WriteText(folder_ / "objects" / "animation.gif", "GIF89a");
  const ProgramResult result = Index();
  EXPECT_EQ(result.status, 3) << result.err;
  const Json json = result.json();
  EXPECT_EQ(json["indexed"], 4);
  std::vector<std::string> names;
  for (const Json& skipped : json["skipped"]) {
    names.push_back(std::filesystem::path(skipped["file"].get<std::string>()).filename());
    EXPECT_FALSE(skipped["reason"].get<std::string>().empty());
  }
  EXPECT_THAT(names, ElementsAre("animation.gif", "cut.png", "empty.jpg", "plain.png", "text.png"));
  const ProgramResult text =
      RunProgram({"index", objects_, "--db", db_, "--descriptor", "rootsift"});
  EXPECT_EQ(text.status, 3);
  EXPECT_THAT(text.err, HasSubstr("cut.png: "));
  EXPECT_THAT(text.out, HasSubstr("indexed 0, unchanged 4, skipped 5"));
}

TEST_F(CliTest, LinksLoopsAndOddNames) {
  WriteObjects(1);
  const std::filesystem::path odd =
      folder_ / "objects" / "caf\xe9 \xc3\xa4";  // Latin-1, then UTF-8
  WriteBytes(odd / "a\nb.png", RandomPng(60));
  std::filesystem::create_directory_symlink(folder_ / "objects", odd / "loop");
  std::filesystem::create_symlink(folder_ / "nowhere.png", odd / "broken.png");
  ASSERT_EQ(::mkfifo((odd / "pipe.png").c_str(), 0666), 0);
  const ProgramResult result = Index();
  EXPECT_EQ(result.status, 3);
  const Json json = result.json();
  EXPECT_EQ(json["indexed"], 2) << result.out;
  EXPECT_EQ(json["skipped"].size(), 2u);
  EXPECT_EQ(Query(60)["hits"][0]["object"], "caf\\xe9 \xc3\xa4");
}

TEST_F(CliTest, ObjectsAreNamedAsAsked) {
  WriteBytes(folder_ / "flat" / "cup.png", RandomPng(1));
  WriteBytes(folder_ / "flat" / "hat.png", RandomPng(2));
  const auto object_of_first = [&](const std::vector<std::string>& more,
                                   const std::string& inputs) {
    std::filesystem::remove(db_);
    std::vector<std::string> arguments = {
        "index", (folder_ / inputs).string(), "--db", db_, "--descriptor", "rootsift"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    EXPECT_EQ(RunProgram(arguments).status, 0);
    return Query(1, {"--group-by", "image"})["hits"][0]["object"];
  };
  EXPECT_EQ(object_of_first({}, "flat"), "cup") << "a flat folder of many things";
  EXPECT_EQ(object_of_first({"--object-from", "folder"}, "flat"), "flat");
  EXPECT_EQ(object_of_first({"--object-from", "stem"}, "flat"), "cup");
  EXPECT_TRUE(object_of_first({"--object-from", "none"}, "flat").is_null());
}

TEST_F(CliTest, AVocabularyThatWasOutgrownIsReplaced) {
  WriteBytes(folder_ / "few" / "0.png", RandomPng(70));
  for (int i = 1; i < 6; ++i) {
    WriteBytes(folder_ / "many" / (std::to_string(i) + ".png"), RandomPng(70 + i));
  }
  const auto vocabulary_after = [&](const std::string& input) {
    const ProgramResult result = RunProgram(
        {"index", (folder_ / input).string(), "--db", db_, "--descriptor", "rootsift", "--json"});
    EXPECT_EQ(result.status, 0) << result.err;
    return result.json()["vocabulary"];
  };
  const Json first = vocabulary_after("few");
  const Json second = vocabulary_after("many");
  EXPECT_EQ(second["trained"], true);
  EXPECT_NE(second["id"], first["id"]);
  EXPECT_GT(second["words"], first["words"]);
  const Json third = vocabulary_after("many");
  EXPECT_EQ(third["trained"], false);
  EXPECT_EQ(third["id"], second["id"]) << "the new one is in use";
  // What somebody chose stays.
  ASSERT_EQ(RunProgram({"vocab", "use", first["id"].dump(), "--db", db_}).status, 0);
  WriteBytes(folder_ / "few" / "1.png", RandomPng(90));
  const Json chosen = vocabulary_after("few");
  EXPECT_EQ(chosen["trained"], false);
  EXPECT_EQ(chosen["id"], first["id"]);
}

TEST_F(CliTest, ImagesComeFromStandardInput) {
  WriteBytes(folder_ / "q.png", RandomPng(1));
  const auto described = [&](const std::string& redirection, const std::string& image) {
    const auto out = folder_ / (image == "-" ? "piped.npz" : "named.npz");
    const ProgramResult result =
        Program({"-c", PliantPath().string() + " describe " + image +
                           " --descriptor rootsift --out " + out.string() + redirection},
                {}, "/bin/sh")
            .Wait();
    EXPECT_EQ(result.status, 0) << result.err;
    return ReadBytes(out);
  };
  const std::string file = (folder_ / "q.png").string();
  EXPECT_EQ(described(" < " + file, "-"), described("", file));
  const ProgramResult empty =
      Program(
          {"-c", PliantPath().string() + " describe - --out x.npz --descriptor orb < /dev/null"},
          {}, "/bin/sh")
          .Wait();
  EXPECT_EQ(empty.status, 1);
  EXPECT_THAT(empty.err, StartsWith("pliant: standard input: "));
}

TEST_F(CliTest, ErrorsOfImagesNameThem) {
  WriteBytes(folder_ / "good.png", RandomPng(1));
  WriteText(folder_ / "bad.jpg", "no image");
  const std::string good = (folder_ / "good.png").string();
  const std::string bad = (folder_ / "bad.jpg").string();
  for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
           {"describe", bad, "--descriptor", "orb", "--out", (folder_ / "x.npz").string()},
           {"match", good, bad, "--descriptor", "orb"}}) {
    const ProgramResult result = RunProgram(arguments);
    EXPECT_EQ(result.status, 1);
    EXPECT_THAT(result.err, StartsWith("pliant: " + bad + ": "));
  }
}

}  // namespace
}  // namespace pliant::testing
