// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// pliant selftest --db FILE
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>

#include "index/cli/command.h"
#include "index/cli/engine_flags.h"
#include "index/cli/interrupt.h"
#include "index/cli/progress.h"
#include "index/selftest/self_test.h"
#include "index/selftest/self_test_json.h"

namespace pliant::cli {
namespace {

struct Options {
  EngineOptions engine;
  SelfTestOptions test;
  bool calibrate = false;
  bool json = false;
};

constexpr std::size_t kListed = 5;  // of each list, in the text

std::string Percent(const Json& share) {
  if (share.is_null()) return "-";
  return fmt::format("{:>3.0f} %  ({:.0f} to {:.0f})", 100 * share["share"].get<double>(),
                     100 * share["low"].get<double>(), 100 * share["high"].get<double>());
}

std::string NameOf(const Json& object, const Json& image_id) {
  return (object.is_null() ? image_id : object).get<std::string>();
}

void PrintList(const Json& list, const std::string& title, auto line) {
  if (list.empty()) return;
  Print("{}", title);
  for (std::size_t i = 0; i < std::min(kListed, list.size()); ++i) Print("  {}", line(list[i]));
  if (list.size() > kListed) Print("  and {} more (--json)", list.size() - kListed);
}

void PrintDifficulties(const Json& report) {
  for (const Json& row : report["by_size"]) {
    Print("  {:>2.0f} to {:>3.0f} % of the width          {}", 100 * row["from"].get<double>(),
          100 * row["to"].get<double>(), Percent(row["found"]));
  }
  for (const Json& row : report["by_strength"]) {
    Print("  deformation {:.1f}                  {}", row["strength"].get<double>(),
          Percent(row["found"]));
  }
}

void PrintText(const Json& report, double found_from) {
  const Json& outcomes = report["outcomes"];
  Print("{} simulated photos of {} images, in {:.0f} s; shares with 95 % intervals",
        report["photos"].get<int>(), report["images"].get<int>(), report["seconds"].get<double>());
  Print("  found                            {}", Percent(outcomes["found"]));
  Print("  perhaps                          {}", Percent(outcomes["perhaps"]));
  Print("  missed                           {}", Percent(outcomes["missed"]));
  Print("  another object found             {}", Percent(outcomes["wrong"]));
  Print("  false alarms, without the object {}", Percent(outcomes["false_alarms"]));
  Print("found by difficulty:");
  PrintDifficulties(report);
  PrintList(report["similar"], "too similar:", [](const Json& pair) {
    return fmt::format("{} and {} (photos: {})", NameOf(pair["object"], pair["image_id"]),
                       NameOf(pair["other"], pair["other_image"]), pair["confused"].get<int>());
  });
  PrintList(report["plain"], "few details:", [](const Json& image) {
    return fmt::format("{}, {} keypoints", NameOf(image["object"], image["image_id"]),
                       image["keypoints"].get<int>());
  });
  const double rate = report["false_alarm_rate"];
  if (report["reaches_rate"].get<bool>()) {
    Print(
        "a hit counts as found from a probability of {:.2f}; {:.2f} keeps false alarms at {:.1f} %",
        found_from, report["found_from"].get<double>(), 100 * rate);
  } else if (const double needed = std::ceil(1 / rate - 1); report["photos"] < needed) {
    Print("--pictures {:.0f} or more can show which probability keeps false alarms at {:.1f} %",
          needed, 100 * rate);
  } else {
    Print("no limit of the probability keeps false alarms at {:.1f} %: objects are too similar",
          100 * rate);
  }
}

ExitStatus Run(Options& options) {
  const Interrupt interrupt;
  options.engine.create = false;
  options.engine.read_only = !options.calibrate;
  options.test.stop = interrupt.token();
  Engine engine(options.engine);
  Progress progress("photos");
  options.test.progress = progress.Counter();
  const SelfTestReport report = RunSelfTest(engine, options.test);
  const std::string& collection = options.test.collection;
  if (options.calibrate && report.reaches_rate) {
    engine.ChangeCollection(collection, {.found_from = report.found_from});
  }
  const Json json = SelfTestJson(report, options.test, /*examples=*/false);
  if (options.json) {
    PrintJson(json);
  } else {
    PrintText(json, engine.GetCollection(collection).found_from);
  }
  return ExitStatus::kDone;
}

}  // namespace

void AddSelfTestCommand(CLI::App& program, ExitStatus& status) {
  auto options = std::make_shared<Options>();
  CLI::App* app = program.add_subcommand(
      "selftest", "Predict how well photos of a collection's objects will be found");
  AddDatabaseFlag(*app, options->engine);
  AddCollectionFlag(*app, options->test.collection);
  app->add_option("--pictures", options->test.pictures, "number of simulated photos")
      ->check(Between(1, 10'000));
  app->add_option("--false-alarms", options->test.false_alarms,
                  "highest share of photos of absent objects that may be found")
      ->check(AboveZero(1));
  AddSeedFlag(*app, options->test.seed, "same seed, same photos");
  AddJobsFlag(*app, options->test.threads, "threads, one photo each");
  app->add_flag("--calibrate", options->calibrate,
                "from now on, count hits as found from the advised probability");
  AddJsonFlag(*app, options->json);
  app->footer("Example:  pliant selftest --db my.db");
  app->callback([options, &status] { status = Run(*options); });
}

}  // namespace pliant::cli
