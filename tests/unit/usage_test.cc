// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Checks and errors of command lines.
#include "index/usage/usage.h"

#include <algorithm>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace pliant::cli {
namespace {

using ::testing::HasSubstr;

enum class Fruit { kApple, kPear };

struct Program {
  Program() {
    app.require_subcommand(1);
    app.failure_message(UsageError);
    app.formatter(std::make_shared<HelpFormatter>());
    CLI::App* eat = app.add_subcommand("eat", "Eat fruit, it's good");
    eat->add_option("FILE", file, "what")->required();
    AddChoice<Fruit>(*eat, "--fruit", fruit, "which",
                     {{"apple", Fruit::kApple}, {"pear", Fruit::kPear}});
    AddChoice<Fruit>(*eat, "--salad", salad, "several",
                     {{"apple", Fruit::kApple}, {"pear", Fruit::kPear}});
    eat->add_option("--count,-n", count, ".how many")->check(Between(1, 9))->capture_default_str();
    eat->add_option("--share", share, "of it")->check(AboveZero());
    eat->add_option("--rest", share, "of it")->check(AtLeast(0.5));
    eat->add_option("--most-of", share, "it")->check(Within(0.5, 1));
    eat->add_option("--days", count, "ago");
    eat->add_flag("--peel,!--no-peel", peel, "it");
    CLI::App* box = app.add_subcommand("box", "Boxes");
    box->require_subcommand(1);
    box->add_subcommand("open", "Open one")->add_option("--db", file, "where");
    box->add_subcommand("close", "Close one");
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
  bool peel = true;
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
              HasSubstr("fruit does not take eta; did you mean eat?\nRun fruit --help"));
  EXPECT_THAT(say({"xylophone"}), HasSubstr("fruit does not take xylophone\n"));
  EXPECT_THAT(say({}), HasSubstr("A subcommand is required\n"));
  EXPECT_THAT(say({"box", "opne"}), HasSubstr("fruit box does not take opne; did you mean open?"));
  EXPECT_THAT(say({"box", "open", "--bd", "x"}),
              HasSubstr("fruit box open does not take --bd; did you mean --db?"));
  EXPECT_THAT(say({"eat", "x", "--frut", "pear"}),
              HasSubstr("does not take --frut; did you mean --fruit?"));
  EXPECT_THAT(say({"eat", "--cuont=4"}), HasSubstr("not take --cuont; did you mean --count?"))
      << "not that FILE is missing";
  EXPECT_THAT(say({"eat", "x", "y"}), HasSubstr("fruit eat does not take y\nRun fruit eat --help"));
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
  EXPECT_THAT(Program().Say({"eat", "x", "--count"}), HasSubstr("--count: a value is missing\n"));
  EXPECT_THAT(Program().Say({"eat", "x", "--count", "2", "--count", "3"}),
              HasSubstr("--count: can be given only once\n"));
  EXPECT_THAT(Program().Say({"eat", "x", "--days", "1.5"}),
              HasSubstr("--days: must be a whole number, not 1.5\n"));
  EXPECT_THAT(Program().Say({"eat", "x", "--most-of", "2"}),
              HasSubstr("--most-of: must be a number from 0.5 to 1, not 2\n"));
  for (const char* share : {"0", "-1", "inf", "nan", "much"}) {
    EXPECT_THAT(Program().Say({"eat", "x", "--share", share}),
                HasSubstr("must be more than 0, not"));
  }
  EXPECT_THAT(Program().Say({"eat", "x", "--rest", "0.4"}),
              HasSubstr("must be 0.5 or more, not 0.4"));
  EXPECT_EQ(Program().Say({"eat", "x", "--rest", "0.5"}), "");
}

TEST(Usage, HelpHasNoTypesOfTheProgram) {
  Program program;
  EXPECT_EQ(program.Say({"eat", "x"}), "");
  const std::string help = program.app.get_subcommands().front()->help();
  EXPECT_THAT(help, HasSubstr("FILE REQUIRED "));
  EXPECT_THAT(help, HasSubstr("--days N "));
  EXPECT_THAT(help, HasSubstr("--share NUMBER "));
  EXPECT_THAT(help, HasSubstr("--peel,--no-peel "));
}

TEST(Usage, ErrorsOfTheLibraryNameTheFlag) {
  Program program;
  EXPECT_EQ(program.Say({"eat", "x"}), "");
  const auto named = [&](const char* reason, const char* message,
                         ErrorCode code = ErrorCode::kInvalidArgument) {
    return WithFlagNames(Error(code, reason, message), &program.app);
  };
  EXPECT_EQ(named("bad_share", "most_of must be more"), "--most-of must be more");
  EXPECT_EQ(named("count_invalid", "count: must be less"), "--count: must be less");
  EXPECT_EQ(named("count_invalid", "count.x is wrong"), "--count: count.x is wrong");
  EXPECT_EQ(named("fruit_invalid", "a fruit has no wheels"), "--fruit: a fruit has no wheels");
  EXPECT_EQ(named("wheels_invalid", "wheels are missing"), "wheels are missing");
  EXPECT_EQ(named("count_invalid", "count is high", ErrorCode::kCorrupt), "count is high");
}

TEST(Usage, TheClosestNameIsNotAnyName) {
  EXPECT_EQ(DidYouMean("--verfy-depth", {"--verify", "--verify-depth"}),
            "; did you mean --verify-depth?");
  EXPECT_EQ(DidYouMean("--colection", {"--count", "--collection"}), "; did you mean --collection?");
  EXPECT_EQ(DidYouMean("--key", {"--max-keypoints", "--jobs"}), "");
  EXPECT_EQ(DidYouMean("x", {"a", "b"}), "");
  EXPECT_EQ(DidYouMean("", {"a", "b"}), "");
  EXPECT_EQ(DidYouMean(std::string(1'000'000, 'a'), {"a"}), "");
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
  EXPECT_THAT(said("lisen = \"here\""), HasSubstr("lisen; did you mean --listen?"));
  EXPECT_THAT(said("[other]\nlisten = \"here\""), HasSubstr("other"));
  EXPECT_THAT(said("listen here"), HasSubstr("unknown setting: listen here"));
  EXPECT_THAT(said("\xff = 1"), HasSubstr("unknown setting: ?"));
}

}  // namespace
}  // namespace pliant::cli
