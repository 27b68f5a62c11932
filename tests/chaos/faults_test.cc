// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Every operation, interrupted everywhere: power loss, calls that fail, a full disk.
//
// By default about every tenth point is tried; PLIANT_CHAOS=exhaustive tries all,
// PLIANT_CHAOS_AT=N that one alone.
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/chaos/faults/campaign.h"

namespace pliant::chaos {
namespace {

struct Tally {
  std::uint64_t points = 0;
  std::uint64_t tried = 0;
  std::uint64_t violations = 0;
};
std::map<std::pair<std::string, std::string>, Tally> tallies;

std::string running;  // scenario, fault and point, for a program that ends

class Figures : public ::testing::Environment {
 public:
  void SetUp() override {
    std::set_terminate([] {
      std::fprintf(stderr, "the program was ended: %s\n", running.c_str());
      std::abort();
    });
  }
  void TearDown() override {
    std::printf("%-26s %-18s %7s %7s %10s\n", "scenario", "fault", "points", "tried", "violations");
    for (const auto& [name, tally] : tallies) {
      std::printf("%-26s %-18s %7llu %7llu %10llu\n", name.first.c_str(), name.second.c_str(),
                  static_cast<unsigned long long>(tally.points),
                  static_cast<unsigned long long>(tally.tried),
                  static_cast<unsigned long long>(tally.violations));
    }
  }
};
const ::testing::Environment* const figures =
    ::testing::AddGlobalTestEnvironment(new Figures);  // gtest deletes it

constexpr int kMostShown = 6;  // problems of a scenario and fault

bool Exhaustive() {
  const char* wish = std::getenv("PLIANT_CHAOS");
  return wish != nullptr && std::string(wish) == "exhaustive";
}

std::uint64_t OnlyAt() {
  const char* wish = std::getenv("PLIANT_CHAOS_AT");
  return wish == nullptr ? 0 : std::strtoull(wish, nullptr, 10);
}

class Faults : public ::testing::TestWithParam<Scenario> {
 protected:
  // Tries one point after the other until the scenario ends without the fault.
  template <typename Try>
  void Everywhere(const std::string& fault, std::uint64_t step, Try&& attempt) {
    if (Exhaustive()) step = 1;
    Tally& tally = tallies[{GetParam().name, fault}];
    int shown = 0;
    for (std::uint64_t at = OnlyAt() != 0 ? OnlyAt() : 1 + first_++ % step;; at += step) {
      running = GetParam().name + ", " + fault + " at " + std::to_string(at);
      const Verdict verdict = attempt(at);
      if (verdict.struck) tally.points = at;
      ++tally.tried;
      if (!verdict.problems.empty()) ++tally.violations;
      for (const std::string& problem : verdict.problems) {
        if (++shown > kMostShown) break;
        ADD_FAILURE() << fault << " at " << at << " (" << verdict.victim << "): " << problem;
      }
      if (!verdict.struck || OnlyAt() != 0) break;
    }
  }

  // Every point where the fault has found a defect once, so that it is not made again.
  static std::uint64_t StepOf(const std::set<std::string>& scenarios) {
    return scenarios.contains(GetParam().name) ? 1 : 10;
  }

  Campaign campaign_{GetParam()};

 private:
  inline static std::uint64_t first_ = 0;
};

TEST_P(Faults, PowerIsLost) {
  const auto lose = [this](Keep keep) {
    return [this, keep](std::uint64_t at) { return campaign_.LosePower(at, keep, at); };
  };
  Everywhere("power, synced", 4, lose(Keep::kNothing));
  Everywhere("power, torn", 4, lose(Keep::kPart));
  Everywhere("killed", 12, lose(Keep::kEverything));
}

TEST_P(Faults, CallsFail) {
  const auto fail = [this](unsigned calls, int error, bool lasting) {
    return [this, calls, error, lasting](std::uint64_t at) {
      return campaign_.Fail({Fault::Kind::kError, calls, at, lasting, error});
    };
  };
  Everywhere("EIO", 8, fail(kChanges, EIO, false));
  Everywhere("EIO from then on", 12, fail(kChanges, EIO, true));
  Everywhere("EIO reading", StepOf({"create_database_files"}), fail(kReads, EIO, false));
  Everywhere("EIO flushing",
             StepOf({"create_database_files", "move_to_other_files", "upload_files"}),
             fail(kFlushes, EIO, false));
  Everywhere("EMFILE", StepOf({"upload"}), fail(kOpens | kAdds, EMFILE, false));
  Everywhere("ENOSPC", 12, fail(kGrows, ENOSPC, false));
  Everywhere("ENOSPC until freed", 12, fail(kGrows, ENOSPC, true));
  Everywhere("short write", 16, [this](std::uint64_t at) {
    return campaign_.Fail({Fault::Kind::kShortWrite, kWrites, at, false, 0});
  });
}

INSTANTIATE_TEST_SUITE_P(Of, Faults, ::testing::ValuesIn(Scenarios()),
                         [](const auto& scenario) { return scenario.param.name; });

}  // namespace
}  // namespace pliant::chaos
