// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Retrieval on simulated objects of painted textures: small for every run, larger (Full) for the
// slow set.
#include <algorithm>
#include <cstdio>

#include <gtest/gtest.h>

#include "descriptor/simulation/simulate.h"
#include "index/evaluation/retrieval_evaluation.h"
#include "tests/accuracy/baseline.h"
#include "tests/unit/index_test_images.h"

namespace pliant::testing {
namespace {

constexpr std::size_t kTen = 10;

struct Figures {
  RetrievalReport report;

  const RetrievalResult& Row(const std::string& descriptor, const std::string& protocol) const {
    const auto found =
        std::find_if(report.results.begin(), report.results.end(), [&](const RetrievalResult& row) {
          return row.descriptor == descriptor && row.protocol == protocol;
        });
    if (found == report.results.end()) std::abort();
    return *found;
  }
};

Figures Measure(int objects, int views, const RetrievalOptions& options, int width, int height) {
  const TemporaryFolder folder;
  SimulateOptions simulate;
  simulate.textures = "procedural";
  simulate.preset = "objects";
  simulate.out = folder.path() / "set";
  simulate.scenes = objects;
  simulate.views = views + 1;  // and the reference
  simulate.width = width;
  simulate.height = height;
  simulate.seed = 7;
  Simulate(simulate);
  Figures figures{EvaluateRetrieval(
      ReadRetrievalSet(folder.path() / "set", RetrievalLayout::kObjects), options)};
  EXPECT_EQ(figures.report.queries, static_cast<std::size_t>(objects));
  // A view now and then shows too little of the object to be described.
  EXPECT_LE(figures.report.skipped.size(), static_cast<std::size_t>(objects * views / 20));
  return figures;
}

void CheckAgainst(Baseline& baseline, const Figures& figures) {
  for (const RetrievalResult& row : figures.report.results) {
    const std::string name = row.descriptor + " " + row.protocol + " ";
    for (const std::size_t k : {std::size_t{1}, std::size_t{3}, kTen}) {
      baseline.Check(name + "@" + std::to_string(k), row.mean.accuracy_at[k - 1]);
    }
    baseline.Check(name + "mAP", row.mean.map);
  }
}

// Whatever the vocabulary and the set: looking at the matches makes no answer worse. Far down,
// where nothing verifies, one image that six keypoints confuse with the query may push one other
// out.
void ExpectVerificationNeverLowers(const Figures& figures, const std::string& descriptor) {
  const RetrievalResult& with = figures.Row(descriptor, "default");
  const RetrievalResult& without = figures.Row(descriptor, "unverified");
  const double answers = static_cast<double>(figures.report.queries) * figures.report.seeds;
  EXPECT_GE(with.mean.map, without.mean.map) << descriptor;
  for (std::size_t k = 0; k < kAccuracyRanks; ++k) {
    const double one_image = k < 5 ? 0 : 1 / (answers * static_cast<double>(k + 1));
    EXPECT_GE(with.mean.accuracy_at[k], without.mean.accuracy_at[k] - one_image - 1e-9)
        << descriptor << ", K = " << k + 1;
  }
}

RetrievalOptions AllProtocols(const std::vector<std::string>& descriptors) {
  RetrievalOptions options;
  options.descriptors = descriptors;
  options.protocols = {RetrievalProtocol::kPaper, RetrievalProtocol::kDefault,
                       RetrievalProtocol::kUnverified};
  return options;
}

TEST(RetrievalAccuracyTest, SmallSet) {
  RetrievalOptions options = AllProtocols({"deal", "rootsift"});
  options.seeds = 2;
  options.extraction.keypoints.max_keypoints = 300;
  const Figures figures = Measure(10, 3, options, 400, 300);
  Baseline baseline("retrieval_small", 0.06);  // one answer of ten, in one of two seeds
  CheckAgainst(baseline, figures);
  for (const std::string descriptor : {"deal", "rootsift"})
    ExpectVerificationNeverLowers(figures, descriptor);
}

// As many objects as the painted textures allow without showing one behind another.
TEST(RetrievalAccuracyTest, FullSet) {
  const std::vector<std::string> names = {"deal", "deal-fixed", "rootsift", "sift", "orb"};
  RetrievalOptions options = AllProtocols(names);
  options.seeds = 3;
  const Figures figures = Measure(48, 10, options, 640, 480);
  for (const RetrievalResult& row : figures.report.results) {
    std::printf("%-12s %-12s @1 %.3f @5 %.3f @10 %.3f mAP %.3f\n", row.descriptor.c_str(),
                row.protocol.c_str(), row.mean.accuracy_at[0], row.mean.accuracy_at[4],
                row.mean.accuracy_at[kTen - 1], row.mean.map);
  }
  for (const std::string& name : names) {
    ExpectVerificationNeverLowers(figures, name);
    if (name.starts_with("deal")) continue;
    for (const std::string protocol : {"paper", "default"}) {
      const RetrievalMetrics& deal = figures.Row("deal", protocol).mean;
      const RetrievalMetrics& other = figures.Row(name, protocol).mean;
      for (std::size_t k = 0; k < kTen; ++k) {
        EXPECT_GE(deal.accuracy_at[k], other.accuracy_at[k])
            << "deal against " << name << ", " << protocol << ", K = " << k + 1;
      }
    }
  }
}

}  // namespace
}  // namespace pliant::testing
