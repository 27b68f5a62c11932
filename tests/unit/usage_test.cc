// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// What command lines say about themselves.
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "index/usage/checks.h"
#include "index/usage/closest_name.h"
#include "index/usage/completion.h"
#include "index/usage/help_format.h"
#include "index/usage/manual.h"
#include "index/usage/usage_error.h"
#include "tests/unit/expect_error.h"
#include "tests/unit/index_test_pictures.h"

namespace pliant::cli {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

enum class Fruit { kApple, kPear };

struct Program {
  Program() {
    app.require_subcommand(1);
    app.failure_message(UsageError);
    app.formatter(std::make_shared<HelpFormat>());
    CLI::App* eat = app.add_subcommand("eat", "Eat fruit, it's good");
    eat->add_option("FILE", file, "what")->required();
    AddChoice<Fruit>(*eat, "--fruit", fruit, "which",
                     {{"apple", Fruit::kApple}, {"pear", Fruit::kPear}});
    AddChoices<Fruit>(*eat, "--salad", salad, "several",
                      {{"apple", Fruit::kApple}, {"pear", Fruit::kPear}});
    eat->add_option("--count,-n", count, ".how many")->check(Between(1, 9))->capture_default_str();
    eat->add_option("--share", share, "of it")->check(AboveZero());
    eat->add_option("--rest", share, "of it")->check(AtLeast(0.5));
    CLI::App* box = app.add_subcommand("box", "Boxes");
    box->require_subcommand(1);
    box->add_option("--db", file, "where");
    box->add_subcommand("open", "Open one")->fallthrough();
    box->add_subcommand("close", "Close one")->fallthrough();
  }

  // What is printed for "fruit ARGUMENTS"; empty = it makes sense.
  std::string Say(std::vector<std::string> arguments) {
    std::reverse(arguments.begin(), arguments.end());
    try {
      app.parse(arguments);
    } catch (const CLI::ParseError& error) {
      return UsageError(&app, error);
    }
    return "";
  }

  CLI::App app{"Fruit", "fruit"};
  std::string file;
  Fruit fruit = Fruit::kApple;
  std::vector<Fruit> salad;
  int count = 3;
  double share = 1;
};

TEST(Usage, ChoicesAreTaken) {
  Program program;
  EXPECT_EQ(program.Say({"eat", "x", "--fruit", "pear", "--salad", "pear,apple", "-n", "9"}), "");
  EXPECT_EQ(program.fruit, Fruit::kPear);
  EXPECT_THAT(program.salad, ::testing::ElementsAre(Fruit::kPear, Fruit::kApple));
  EXPECT_EQ(program.count, 9);
}

TEST(Usage, ErrorsSayWhatWasMeant) {
  const auto say = [](std::vector<std::string> arguments) {
    return Program().Say(std::move(arguments));
  };
  EXPECT_THAT(say({"eta", "x"}),
              HasSubstr("fruit has no command eta; did you mean eat?\nRun fruit --help"));
  EXPECT_THAT(say({"xylophone"}), HasSubstr("fruit has no command xylophone\n"));
  EXPECT_THAT(say({}), HasSubstr("fruit needs a command: eat box\n"));
  EXPECT_THAT(say({"box", "opne"}), HasSubstr("fruit box has no command opne; did you mean open?"));
  EXPECT_THAT(say({"box", "open", "--bd", "x"}),
              HasSubstr("fruit box open has no option --bd; did you mean --db?"));
  EXPECT_THAT(say({"eat", "x", "--frut", "pear"}),
              HasSubstr("has no option --frut; did you mean --fruit?"));
  EXPECT_THAT(say({"eat", "--cuont=4"}), HasSubstr("has no option --cuont; did you mean --count?"))
      << "not that FILE is missing";
  EXPECT_THAT(say({"eat", "x", "y"}),
              HasSubstr("fruit eat takes no further argument: y\nRun fruit eat --help"));
  EXPECT_THAT(say({"eat", "x", "--fruit", "aple"}),
              HasSubstr("--fruit: must be apple or pear, not aple; did you mean apple?"));
  EXPECT_THAT(say({"eat", "x", "--salad", "pear,fish"}),
              HasSubstr("--salad: must be apple or pear, not fish\n"));
  EXPECT_THAT(say({"eat"}), HasSubstr("FILE is required"));
}

TEST(Usage, NumbersAreChecked) {
  for (const char* count : {"0", "10", "two", "3.5", "1e0", "99999999999999999999", "nan", " 3"}) {
    EXPECT_THAT(Program().Say({"eat", "x", std::string("--count=") + count}),
                HasSubstr("must be a whole number from 1 to 9, not " + std::string(count)));
  }
  EXPECT_THAT(Program().Say({"eat", "x", "--count"}), HasSubstr("--count needs a value\n"));
  for (const char* share : {"0", "-1", "inf", "nan", "much"}) {
    EXPECT_THAT(Program().Say({"eat", "x", "--share", share}),
                HasSubstr("must be more than 0, not"));
  }
  EXPECT_THAT(Program().Say({"eat", "x", "--rest", "0.4"}),
              HasSubstr("must be 0.5 or more, not 0.4"));
  EXPECT_EQ(Program().Say({"eat", "x", "--rest", "0.5"}), "");
}

TEST(Usage, TheClosestNameIsNotAnyName) {
  EXPECT_EQ(ClosestName("verfy-depth", {"--verify", "--verify-depth"}), "--verify-depth");
  EXPECT_EQ(ClosestName("--colection", {"--count", "--collection"}), "--collection");
  EXPECT_EQ(ClosestName("--key", {"--max-keypoints", "--jobs"}), "");
  EXPECT_EQ(ClosestName("--max", {"--max-keypoints", "--jobs"}), "--max-keypoints");
  EXPECT_EQ(ClosestName("x", {"a", "b"}), "");
  EXPECT_EQ(ClosestName("", {"a", ""}), "");
  EXPECT_EQ(ClosestName(std::string(1'000'000, 'a'), {"a"}), "");
}

// What bash offers when the last word is completed.
std::string Offered(const std::string& words) {
  const pliant::testing::TemporaryFolder folder;
  const auto script = folder / "completion";
  std::ofstream(script) << CompletionScript(Program().app, "bash");
  const std::string command =
      "bash -c 'source " + script.string() + "; COMP_WORDS=(" + words +
      "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _fruit; echo \"${COMPREPLY[*]}\"'";
  FILE* pipe = popen(command.c_str(), "r");
  char text[1000] = "";
  const std::size_t count = std::fread(text, 1, sizeof text, pipe);
  EXPECT_EQ(pclose(pipe), 0);
  return std::string(text, count);
}

TEST(Usage, BashCompletes) {
  EXPECT_EQ(Offered("fruit e"), "eat\n");
  EXPECT_EQ(Offered("fruit \"\""), "eat box\n");
  EXPECT_EQ(Offered("fruit eat --s"), "--salad --share\n");
  EXPECT_EQ(Offered("fruit eat x --fruit p"), "pear\n");
  EXPECT_EQ(Offered("fruit eat x --fruit = p"), "pear\n") << "as bash splits --fruit=p";
  EXPECT_EQ(Offered("fruit eat x --fruit ="), "apple pear\n");
  EXPECT_EQ(Offered("fruit box o"), "open\n");
  EXPECT_EQ(Offered("fruit box open --d"), "--db\n")
      << "it may stand behind the inner command, too";
  EXPECT_EQ(Offered("fruit eat x --count 4"), "\n") << "nothing: a file is offered";
}

TEST(Usage, OtherShellsHaveEveryOption) {
  const std::string zsh = CompletionScript(Program().app, "zsh");
  EXPECT_THAT(zsh, ::testing::StartsWith("#compdef fruit\n"));
  const std::string fish = CompletionScript(Program().app, "fish");
  EXPECT_THAT(fish, HasSubstr("-l fruit -x -a 'apple pear' -d 'which'"));
  EXPECT_THAT(fish, HasSubstr("-l count -s n -r"));
  EXPECT_THAT(fish, HasSubstr("-a 'eat' -d 'Eat fruit, it'\\''s good'"));
  pliant::testing::ExpectError(ErrorCode::kInvalidArgument, "bad_shell",
                               [] { CompletionScript(Program().app, "tcsh"); });
}

TEST(Usage, SettingsOfAFileThatAreNoneAreNamed) {
  const auto said = [](const std::string& settings) {
    const std::string file = ::testing::TempDir() + "pliant-usage.toml";
    std::ofstream(file) << settings << "\n";
    CLI::App app("", "server");
    std::string listen;
    app.add_option("--listen", listen);
    app.set_config("--config");
    app.allow_config_extras(CLI::config_extras_mode::error);
    std::vector<std::string> arguments = {file, "--config"};  // from the last to the first
    try {
      app.parse(arguments);
    } catch (const CLI::ParseError& error) {
      return UsageError(&app, error);
    }
    return std::string();
  };
  EXPECT_EQ(said("listen = \"here\""), "");
  EXPECT_THAT(said("lisen = \"here\""), HasSubstr("\"lisen\", which is no flag"));
  EXPECT_THAT(said("lisen = \"here\""), HasSubstr("did you mean --listen?"));
  EXPECT_THAT(said("[other]\nlisten = \"here\""), HasSubstr("\"other\", which is no flag"));
  EXPECT_THAT(said("listen here"), HasSubstr("\"listen here\", which is no flag"));
}

TEST(Usage, HelpIsForPeople) {
  Program program;
  CLI::App& eat = *program.app.get_subcommand("eat");
  eat.get_option("--share")->excludes(eat.get_option("--rest"))->envname("FRUIT_SHARE");
  eat.get_option("--rest")->needs(eat.get_option("--count"))->required();
  const std::string help = eat.help();
  EXPECT_THAT(help, ContainsRegex("FILE +what\n"));
  EXPECT_THAT(help, ContainsRegex("--fruit apple\\|pear +which\n"));
  EXPECT_THAT(help, ContainsRegex("-n,--count N +.how many \\(1 to 9; default: 3\\)\n"));
  EXPECT_THAT(help, ContainsRegex("--share N +of it \\(not with --rest; or in FRUIT_SHARE\\)\n"));
  EXPECT_THAT(help, ContainsRegex("--rest N +of it \\(required; only with --count"));
  EXPECT_THAT(help, Not(ContainsRegex("INT|FLOAT|REQUIRED")));
}

TEST(Usage, HelpHasTheOptionsOfTheCommandAbove) {
  Program program;
  CLI::App& box = *program.app.get_subcommand("box");
  const std::string help = box.get_subcommand("open")->help();
  EXPECT_THAT(help, ContainsRegex("Options of every box:\n *--db TEXT +where\n"));
  EXPECT_THAT(box.help(), Not(HasSubstr("Options of every")));
}

TEST(Usage, TheManualHasEverything) {
  const std::string page = ManualPage(Program().app, "fruit 1.2");
  EXPECT_THAT(page, ::testing::StartsWith(".TH FRUIT 1 \"\" \"fruit 1.2\""));
  EXPECT_THAT(page, HasSubstr(".SS fruit eat\n"));
  EXPECT_THAT(page, HasSubstr("\\fB\\-\\-fruit\\fR \\fIapple|pear\\fR\nwhich\n"));
  EXPECT_THAT(page, HasSubstr("\\&.how many (1 to 9) (default: 3)")) << "no request of roff";
  EXPECT_THAT(page, Not(HasSubstr("\n.how")));
}

}  // namespace
}  // namespace pliant::cli
